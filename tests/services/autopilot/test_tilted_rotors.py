"""Tilted rotors: the autopilot's model equals the plant, and the vehicle flies."""

import numpy as np
import pytest

from lapwing.cosim.scene import SceneError
from lapwing.dynamics.effects._axes import thrust_wrench
from lapwing.dynamics.effects._types import Loads
from lapwing.dynamics.vehicles import multirotor
from lapwing.kernels import python_function
from lapwing.services.autopilot import controller_parameters
from lapwing.services.autopilot.allocation import effectiveness, tilted_effectiveness
from lapwing.services.autopilot.nominal_airframe import known_airframe
from lapwing.services.common.schemas.vehicle_schema import airframe
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.simulate import fly
from lapwing.studies.tune.linearise import hover

SCENE = "hexacopter_tilted"


def test_tilted_rotor_model_equals_plant():
    scene = load(SCENE, {"airframe.mass.centre": [0.01, -0.02, 0.03]})
    nominal, frame = known_airframe(scene), airframe(scene)
    thrust = np.array([3.0, 4.0, 5.0, 2.0, 3.5, 4.5])
    loads = Loads(tuple(map(float, thrust)), tuple(map(float, nominal.torque_per_thrust * thrust)))
    force, torque = python_function(thrust_wrench)(multirotor.parameters(frame).layout, loads)
    assert controller_parameters.rotor_effectiveness(nominal) @ thrust == pytest.approx([force[2], *torque], rel=1e-12)


def test_vertical_axes_equal_untilted_rotors():
    x, y, z, reaction = (0.3, -0.2, 0.1), (0.1, 0.4, -0.3), (0.05, 0.0, -0.1), (0.02, -0.02, 0.02)
    tilted = tilted_effectiveness(tuple(zip(x, y, z, strict=True)), ((0.0, 0.0, 1.0),) * 3, reaction)
    assert np.array_equal(tilted, effectiveness(x, y, reaction))


@pytest.mark.long
def test_hexacopter_with_tilted_rotors_hovers_turns_and_lands():
    flight = fly(load(SCENE))
    assert str(flight.outcome).startswith("Landed")
    assert "upright" in str(flight.outcome)
    t = flight.config.interval * np.arange(len(flight.truth))
    hover = (t > 6.5) & (t < 8.0)
    lift = flight.truth.rotor_thrust[hover].sum(axis=1).mean() * np.cos(np.radians(15.0))
    assert lift == pytest.approx(2.4 * 9.80665, rel=0.01)
    assert abs(flight.truth.position[hover][:, :2]).max() < 0.1
    untilted = known_airframe(load("hexacopter"))
    assert (
        controller_parameters.moments(known_airframe(load(SCENE)))[2] > 4.5 * controller_parameters.moments(untilted)[2]
    )


@pytest.mark.long
def test_spin_up_reaction_is_that_of_plant():
    scene = load(SCENE)
    assert known_airframe(scene).spin_up_zero == pytest.approx(hover(scene).spin_up_zero, rel=0.1)


@pytest.mark.parametrize(
    ("model", "axis", "message"),
    [
        ("rigid_body", [[0.0, 3.0, 1.0]] * 4, "maximum thrust"),  # tilted by 72 degrees to the side: cannot hover
        ("rigid_body", [[0.0, 0.0, 0.0]] * 4, r"airframe.rotors.axis.0: expected a direction that points up"),
        ("rigid_body", [[0.0, 0.0, -1.0]] * 4, r"airframe.rotors.axis.0: expected a direction that points up"),
        ("multibody", [[0.1, 0.0, 1.0]] * 4, "rotors.axis: the five-body model needs rotors that push along body z"),
    ],
)
def test_unflyable_rotor_axes_are_rejected(model, axis, message):
    with pytest.raises(SceneError, match=message):
        resolve(load("hover", {"airframe.rotors.axis": axis, "vehicle.model": model}))
