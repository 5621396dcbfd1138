"""Shared load of several vehicles: against the monolithic model `slung_load`, and against statics."""

import math

import numpy as np
import pytest

from lapwing.cosim.config.serialise import first_difference, from_json, to_json
from lapwing.cosim.scene import SceneError
from lapwing.dynamics.integrators import LEAST_TOLERANCE
from lapwing.dynamics.lie.quaternion import rotate
from lapwing.services.scene_resolver import from_resolved, load, parse, resolve
from tests.cosim.memory_log import fly
from tests.cosim.test_agreement import fly_apart
from tests.scenes import head, phase, vehicle

pytestmark = pytest.mark.long

EFFECTS = {"wind_constant": "velocity = [0.0, 0.0, 0.0]"}  # with those below the effects of the scene `carried_load`
CLIMB = phase("climb", 5.0, "trajectory", x=2.0, z=4.0) + phase("hold", 10.0, "trajectory")
COMMON = head(7.0, "air_density", "body_drag", **EFFECTS) + CLIMB
CABLE = "mass = 2.0\nlength = 2.0\ndrag_area = 0.05\nhook = [0.1, 0.0, -0.1]\n"
SHARED = f"[effects.shared_slung_load]\n{CABLE}"
TWO = vehicle("left", start=(0.0, 1.0)) + vehicle("right", start=(0.0, -1.0))


def two_carriers(tmp_path, *overrides):
    return parse(tmp_path / "two.toml", COMMON + SHARED + TWO, overrides)


@pytest.fixture(scope="module")
def config(tmp_path_factory):
    return resolve(two_carriers(tmp_path_factory.mktemp("scene"), "trajectory.phase.0.x.to=0.0"))


@pytest.fixture(scope="module")
def recorded_flight(config):
    return fly(config)


def test_one_carrier_equals_slung_load_model(tmp_path):
    """`slung_load` integrates vehicle and load together, without prediction."""
    alone = '[vehicle]\nairframe = "delivery_drone"\n'
    together = alone + 'model = "slung_load"\n'
    scenes = (
        COMMON + SHARED + alone,
        COMMON + f"[slung_load]\n{CABLE}" + together,
    )
    beside, one = (fly(resolve(parse(tmp_path / "one.toml", text))) for text in scenes)
    loads = [log.view("body_states").position[:, 0] for log in (beside, one)]
    vehicles = [log.view("ground_truth").position for log in (beside, one)]
    assert loads[1][-1, 2] > 1.5
    assert np.abs(loads[0] - loads[1]).max() < 0.002
    assert np.abs(vehicles[0] - vehicles[1]).max() < 0.002


def hook_position(truth):
    """Return the final position of the cable's attachment [m], world."""
    x, y, z, w = map(float, truth.orientation[-1])
    return truth.position[-1] + rotate((w, x, y, z), (0.1, 0.0, -0.1))


def test_static_cables_carry_weight(recorded_flight):
    reported, left, right = (
        recorded_flight.view(name) for name in ("left/body_states", "left/ground_truth", "right/ground_truth")
    )
    assert reported.force[-1, 0] == pytest.approx((0.0, 0.0, 2.0 * 9.80665), abs=0.5)  # small swing along x
    assert reported.force[-1, 0, 2] == pytest.approx(2.0 * 9.80665, abs=0.05)
    place = reported.position[-1, 0]
    assert place[2] > 1.0
    hooks = [hook_position(truth) for truth in (left, right)]
    lengths = [np.linalg.norm(hook - place) for hook in hooks]
    down = (hooks[0][2] - place[2]) / lengths[0]
    stretch = 0.5 * 2.0 * 9.80665 / down / 2000.0  # of each cable, by Hooke's law
    assert lengths == pytest.approx([2.0 + stretch] * 2, abs=5e-4)
    # symmetric about the plane between the carriers
    assert left.position[-1] * (1, -1, 1) == pytest.approx(right.position[-1], abs=1e-6)
    assert left.position[-1, 1] < 0.999  # the cable pulls the carrier inwards


def test_strictest_accuracy_keeps_load_substeps_above_round_off(tmp_path):
    """At the tolerance of the vehicles round-off would reject every substep: a communication step would not end."""
    config = resolve(two_carriers(tmp_path, "solver.accuracy=1e-12", "solver.step=0.001"))
    plants = [settings.parameters for settings in config.services["plant"].parameters.given]
    assert [plant.core.vehicle.tolerance for plant in plants] == [1e-15, 1e-15]
    assert [plant.others.load.tolerance for plant in plants if plant.others.load] == [LEAST_TOLERANCE]


def test_first_carrier_publishes_load(recorded_flight):
    assert "left/body_states" in recorded_flight.topics
    assert "right/body_states" not in recorded_flight.topics


def test_carried_load_is_equal_with_diagram_per_service(config, recorded_flight):
    assert fly_apart(config, None).digest == recorded_flight.digest


def test_configuration_survives_json(config):
    assert first_difference(from_json(to_json(config)), config) is None
    assert first_difference(resolve(from_resolved(config.resolved, "two")), config) is None


@pytest.mark.parametrize(
    ("override", "message"),
    [
        (
            "vehicle.1.effects.shared_slung_load.mass=3.0",
            r"vehicle\.1\.effects\.shared_slung_load\.mass: .*the same load",
        ),
        (
            "vehicle.1.initial_position=[0.0, -6.0]",
            r"effects\.shared_slung_load\.length: .*m away, in the middle of its carriers",
        ),
        ("effects.shared_slung_load.stiffness=1e5", r"effects\.shared_slung_load\.stiffness: .*softer cable"),
        ("vehicle.0.vehicle.model=multibody", "publishes its own bodies"),
    ],
)
def test_invalid_shared_load_is_rejected(tmp_path, override, message):
    with pytest.raises(SceneError, match=message):
        resolve(two_carriers(tmp_path, override))


def test_shipped_scene_lifts_load(tmp_path):
    config = resolve(load("carried_load", ["run.duration=14.0"]))
    log = fly(config)
    reported = log.view("left/body_states")
    assert math.isclose(reported.position[0, 0, 2], 0.0)
    assert reported.position[-1, 0, 2] > 2.5
    assert reported.force[-1, 0, 2] == pytest.approx(3.0 * 9.80665, abs=3.0)
