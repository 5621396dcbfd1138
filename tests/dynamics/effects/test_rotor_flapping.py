"""Rotor flapping against tilts by hand, moments of the tilted thrusts, and the form of the H-force."""

import math

import numpy as np
import pytest

from lapwing.dynamics import effects
from lapwing.dynamics.effects.h_force import h_force
from lapwing.dynamics.effects.rotor_flapping import rotor_flapping

R = 0.2794  # [m]


def make(drone, **table):
    (e,) = effects.from_scene({"rotor_flapping": table}, drone)
    return e


def test_thrust_tilts_with_advance_ratio(drone, situation, rotors):
    """8 m/s at 300 rad/s is mu = 0.0954; the thrust tilts against the air velocity at every heading."""
    e, mu = make(drone, coefficient=0.3), 8.0 / (300.0 * R)
    tilt = 0.3 * mu / (1 - mu**2 / 2)
    force, torque = rotor_flapping.py_func(e, (), situation(velocity=(8, 0, 3), wind=(0, 0, 2)), rotors(thrust=25.0))
    assert force == pytest.approx((-4 * 25.0 * tilt, 0.0, 0.0))
    assert torque == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    force, _ = rotor_flapping.py_func(e, (), situation(velocity=(0, 0, 0), wind=(0, 8, 0)), rotors(thrust=25.0))
    assert force == pytest.approx((0.0, 4 * 25.0 * tilt, 0.0))


def test_coefficient_of_propeller(drone):
    """4 theta_t - 2 lambda: tip angle 0.107 rad, v_h / (w R) from the static thrust at any speed."""
    thrust = effects.from_scene({"rotor_thrust": {}}, drone)[0].thrust_constant * 300.0**2  # over the density
    inflow = math.sqrt(thrust / (2 * math.pi * R**2)) / (300.0 * R)
    assert make(drone).coefficient == pytest.approx(4 * 0.18796 / (2 * math.pi * R) - 2 * inflow)
    assert 0.2 < make(drone).coefficient < 0.4


def test_stiff_hub_pitches_nose_up(drone, situation, rotors):
    """Forward flight turns about -y in FLU; flight to the left rolls to the right, about +x."""
    e, mu = make(drone, coefficient=0.3, stiffness=2.0), 8.0 / (300.0 * R)
    moment = 4 * 2.0 * 0.3 * mu / (1 - mu**2 / 2)
    _, ahead = rotor_flapping.py_func(e, (), situation(velocity=(8, 0, 0)), rotors())
    _, left = rotor_flapping.py_func(e, (), situation(velocity=(0, 8, 0)), rotors())
    assert ahead == pytest.approx((0.0, -moment, 0.0), abs=1e-12)
    assert left == pytest.approx((moment, 0.0, 0.0), abs=1e-12)


def test_low_speed_force_has_form_of_h_force(drone, situation, rotors):
    """T = k_T rho w^2 implies a force -rho (k_T k / R) w v on each rotor, also in rotation."""
    static = effects.from_scene({"rotor_thrust": {}}, drone)[0].thrust_constant
    e = make(drone, coefficient=0.3)
    (same,) = effects.from_scene({"h_force": {"coefficient": 0.3 * static / R}}, drone)
    s = situation(velocity=(0.02, -0.03, 0), omega=(0.01, 0.02, 0.05), speed=(300.0,) * 4)
    pushed = rotors(thrust=static * 1.2 * 300.0**2)
    result, expected = rotor_flapping.py_func(e, (), s, pushed), h_force.py_func(same, (), s, pushed)
    assert np.array(result) == pytest.approx(np.array(expected), rel=1e-6, abs=1e-12)


def test_tilt_is_limited_beyond_valid_range(drone, situation, rotors):
    e = make(drone, coefficient=0.3)
    force, _ = rotor_flapping.py_func(e, (), situation(velocity=(0, 900.0, 0)), rotors(thrust=25.0))
    assert force == pytest.approx((0.0, -100.0 * 0.3 * 0.5 / (1 - 0.125), 0.0))
    force, _ = rotor_flapping.py_func(e, (), situation(speed=(0.0,) * 4, velocity=(3, 0, 0)), rotors(thrust=0.0))
    assert force == (0.0, 0.0, 0.0)
