import pytest

from lapwing.dynamics import effects
from lapwing.dynamics.effects.body_wrench import body_wrench


def test_wrench_is_constant_in_body(drone, situation, rotors):
    (e,) = effects.from_scene({"body_wrench": {"force": [1.0, -2.0, 3.0], "torque": [0.1, 0.2, -0.3]}}, drone)
    for turn in ((0.0, 0.0, 0.0), (0.2, -0.3, 0.5)):
        force, torque = body_wrench.py_func(e, (), situation(turn=turn, velocity=(3, 0, 1)), rotors())
        assert force == (1.0, -2.0, 3.0)
        assert torque == (0.1, 0.2, -0.3)


def test_wrench_is_zero_by_default(drone, situation, rotors):
    (e,) = effects.from_scene({"body_wrench": {}}, drone)
    assert body_wrench.py_func(e, (), situation(), rotors()) == ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def test_non_finite_force_is_rejected(drone):
    with pytest.raises(ValueError, match=r"effects.body_wrench.force"):
        effects.from_scene({"body_wrench": {"force": [float("nan"), 0.0, 0.0]}}, drone)
