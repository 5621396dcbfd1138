import pytest

from lapwing.dynamics import effects
from lapwing.dynamics.effects.rotational_drag import rotational_drag


def drag(drone, s, rotors, linear=(0.1, 0.2, 0.3)):
    (e,) = effects.from_scene({"rotational_drag": {"linear": list(linear)}}, drone)
    return rotational_drag.py_func(e, (), s, rotors())


def test_torque_opposes_each_rate(drone, situation, rotors):
    s = situation(omega=(1.0, -2.0, 3.0))
    assert drag(drone, s, rotors) == pytest.approx((-0.1, 0.4, -0.9))


def test_negative_coefficient_is_rejected(drone):
    with pytest.raises(ValueError, match=r"effects.rotational_drag.linear"):
        effects.from_scene({"rotational_drag": {"linear": [0.1, -0.1, 0.1]}}, drone)
