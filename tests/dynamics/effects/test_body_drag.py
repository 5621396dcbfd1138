import numpy as np
import pytest
from effects_helpers import rotation_of

from lapwing.dynamics import effects
from lapwing.dynamics.effects.body_drag import body_drag

pytestmark = pytest.mark.usefixtures("uncompiled")


def drag_world(drone, s, rotors, **table):
    (e,) = effects.from_scene({"body_drag": table}, drone)
    force, torque = body_drag.py_func(e, (), s, rotors())
    assert torque == (0.0, 0.0, 0.0)
    return rotation_of(s) @ force


def test_against_formula_in_world_coordinates(drone, situation, rotors):
    s = situation(velocity=(8, -2, 1), wind=(3, 1, 0), turn=(0.2, -0.3, 0.5))
    v = np.array([5.0, -3.0, 1.0])
    R = rotation_of(s)
    area, linear = np.diag([0.06, 0.06, 0.16]), np.diag([0.1, 0.2, 0.3])
    expected = -R @ (0.5 * 1.2 * np.linalg.norm(v) * area + linear) @ R.T @ v
    assert drag_world(drone, s, rotors, linear=[0.1, 0.2, 0.3]) == pytest.approx(expected, rel=1e-12)


def test_drag_dissipates_energy_and_vanishes_at_wind_speed(drone, situation, rotors):
    s = situation(velocity=(8, -2, 1), turn=(0.2, -0.3, 0.5))
    assert drag_world(drone, s, rotors) @ (8, -2, 1) < 0
    s = situation(velocity=(3, 1, 0), wind=(3, 1, 0))
    assert drag_world(drone, s, rotors) == pytest.approx((0, 0, 0))


def test_airframe_without_areas_is_rejected(drone):
    with pytest.raises(ValueError, match=r"effects.body_drag: needs the key area"):
        effects.from_scene({"body_drag": {}}, drone.model_copy(update={"drag": None}))
