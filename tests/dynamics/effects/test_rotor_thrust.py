import math

import pytest
from effects_helpers import NO_FACTORS, NO_LOADS

from lapwing.dynamics import effects
from lapwing.dynamics.effects.rotor_thrust import rotor_thrust
from lapwing.dynamics.vehicles.propeller import thrust_coefficient, torque_coefficient


def test_loads_by_source_formula(drone, situation):
    """Loads are rho C_T (N / 60)^2 D^4 and rho C_M (N / 60)^2 D^5 at 3168 rpm."""
    (e,) = effects.from_scene({"rotor_thrust": {}}, drone)
    speed = 3168 / 60 * 2 * math.pi
    loads = rotor_thrust.py_func(e, (), situation(speed=(speed,) * 4), NO_FACTORS, NO_LOADS)
    diameter = 22 * 0.0254
    thrust = 1.2 * thrust_coefficient(drone.propeller) * (3168 / 60) ** 2 * diameter**4
    torque = 1.2 * torque_coefficient(drone.propeller) * (3168 / 60) ** 2 * diameter**5
    assert loads.thrust == pytest.approx([thrust] * 4, rel=1e-12)
    assert loads.torque == pytest.approx([torque] * 4, rel=1e-12)


def test_hover_thrust_is_about_half_highest(drone, situation):
    (e,) = effects.from_scene({"rotor_thrust": {}}, drone)
    top = 44.4 / drone.motor.rotor_constant
    loads = rotor_thrust.py_func(e, (), situation(speed=(top,) * 4, density=1.225), NO_FACTORS, NO_LOADS)
    assert loads.thrust[0] == pytest.approx(48.0, abs=0.5)
    assert 1.9 < loads.thrust[0] / (10.0224 * 9.80665 / 4) < 2.0  # the source asks for a ratio of two


def test_airframe_without_propeller_is_rejected(drone):
    bare = drone.model_copy(update={"propeller": None})
    with pytest.raises(ValueError, match=r"effects.rotor_thrust: the vehicle has no \[propeller\]"):
        effects.from_scene({"rotor_thrust": {}}, bare)
