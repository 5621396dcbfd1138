import pytest
from effects_helpers import NO_FACTORS, NO_LOADS

from lapwing.dynamics import effects
from lapwing.dynamics.effects.rotor_quadratic import rotor_quadratic


def test_loads_are_quadratic_in_speed(drone, situation):
    (e,) = effects.from_scene({"rotor_quadratic": {"thrust_constant": 3e-5, "torque_constant": 7e-7}}, drone)
    loads = rotor_quadratic.py_func(e, (), situation(speed=(100, 200, 0, 50)), NO_FACTORS, NO_LOADS)
    assert loads.thrust == pytest.approx([0.3, 1.2, 0.0, 0.075])
    assert loads.torque == pytest.approx([7e-3, 28e-3, 0.0, 1.75e-3])


def test_excludes_other_model(drone):
    with pytest.raises(ValueError, match=r"effects.rotor_thrust: cannot be combined with effects.rotor_quadratic"):
        effects.from_scene(
            {"rotor_thrust": {}, "rotor_quadratic": {"thrust_constant": 1.0, "torque_constant": 1.0}}, drone
        )
