"""Interactions between vehicles of a fleet: collisions and downwash."""

import numpy as np
import pytest

from lapwing.cosim.config.serialise import first_difference, from_json, to_json
from lapwing.cosim.diagram.multi_vehicle import members
from lapwing.services.scene_resolver import from_resolved, parse, reseed, resolve
from tests.cosim.memory_log import fly
from tests.cosim.test_agreement import fly_apart
from tests.scenes import head, phase, vehicle

EFFECTS = ("air_density", "axial_inflow", "body_drag", "downwash", "collision")  # those of the scene `formation`
ABOVE = vehicle("above", phase("up", 2.0, z=4.0), phase("over", 2.0, y=3.0))
SCENE = head(4.0, *EFFECTS) + ABOVE + vehicle("below", phase("up", 2.0, z=1.0), phase("wait", 10.0), start=(0.0, 3.0))


def scene(tmp_path, *overrides):
    return parse(tmp_path / "two.toml", SCENE, overrides)


@pytest.fixture(scope="module")
def config(tmp_path_factory):
    return resolve(scene(tmp_path_factory.mktemp("scene")))


@pytest.fixture(scope="module")
def recorded_flight(config):
    return fly(config)


@pytest.mark.long
def test_downwash_acts_only_below(recorded_flight):
    above, below = (recorded_flight.view(f"{name}/ground_truth").wind for name in ("above", "below"))
    assert -0.2 < above[-1, 2] < 0.0  # inflow of the other vehicle
    assert below[-1, 2] < -2.0
    assert np.abs(below[:200]).max() < 0.05  # 3 m to the side
    height = recorded_flight.view("below/ground_truth").position[:, 2]
    assert height[-1] < height[500] - 0.02  # pushed down


@pytest.mark.long
def test_interaction_is_equal_with_diagram_per_service(config, recorded_flight):
    assert fly_apart(config, None).digest == recorded_flight.digest


@pytest.mark.long
def test_isolated_vehicle_equals_flight_without_effects(tmp_path, config):
    """Without downwash and contact the flights are bit-for-bit those without interactions."""
    far = ["vehicle.1.initial_position=[0.0, 500.0]", "run.duration=1.0"]
    there = fly(resolve(scene(tmp_path, *far)))
    alone = fly(
        members(resolve(scene(tmp_path, *far)))[1]._replace(services=_without_interaction(config, tmp_path, far))
    )
    assert there.payloads("below/ground_truth") == alone.payloads("ground_truth")


def _without_interaction(config, tmp_path, far):
    return resolve(scene(tmp_path, *far).vehicles[1]).services


def test_configuration_survives_json_and_reseed(config, tmp_path):
    assert first_difference(from_json(to_json(config)), config) is None
    assert first_difference(resolve(from_resolved(config.resolved, "two")), config) is None
    assert first_difference(reseed(config, 7), resolve(scene(tmp_path, "run.seed=7"))) is None


@pytest.mark.long
def test_colliding_vehicles_bounce(tmp_path):
    meeting = fly(resolve(scene(tmp_path, "vehicle.0.trajectory.phase.0.z.to=1.0")))
    a, b = (meeting.view(f"{name}/ground_truth").position for name in ("above", "below"))
    gap = np.linalg.norm(a - b, axis=1)
    effects = resolve(scene(tmp_path).vehicles[0]).services["plant"].parameters.core.vehicle.effects
    (radius,) = (effect.radius for effect in effects if hasattr(effect, "radius"))
    assert gap.min() == pytest.approx(2.0 * radius, rel=0.02)
    assert b[-1, 1] > 3.1  # pushed aside


@pytest.mark.parametrize(("start", "away"), [("[0.0, 0.0]", "0"), ("[0.0, 0.9]", "0.9")])
def test_touching_vehicles_are_rejected_at_start(tmp_path, start, away):
    output = f"vehicle.1.initial_position: expected at least 1.55 m between them, got a position {away} m from above"
    with pytest.raises(ValueError, match=output):
        resolve(scene(tmp_path, f"vehicle.1.initial_position={start}"))
