import math

import numpy as np
import pytest
from effects_helpers import NO_FACTORS, NO_LOADS
from scipy.integrate import quad

from lapwing.dynamics import effects
from lapwing.dynamics.effects.axial_inflow import axial_inflow
from lapwing.dynamics.effects.rotor_thrust import rotor_thrust
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.multirotor_equations import STANDARD_DENSITY

pytestmark = pytest.mark.usefixtures("uncompiled")


def both(drone, s):
    inflow, thrust = effects.from_scene({"rotor_thrust": {}, "axial_inflow": {}}, drone)
    static = rotor_thrust.py_func(thrust, (), s, NO_FACTORS, NO_LOADS)
    return static, axial_inflow.py_func(inflow, (), s, NO_FACTORS, static)


def test_thrust_decreases_linearly_to_zero_at_pitch_speed(drone, situation):
    pitch_speed = 300.0 / (2 * math.pi) * drone.propeller.pitch
    for part in (-0.4, 0.1, 0.3, 0.5):
        static, total = both(drone, situation(velocity=(0, 0, part * pitch_speed)))
        assert np.array(total.thrust) / static.thrust == pytest.approx(1 - part)


def test_induced_torque_falls_with_square(drone, situation):
    from lapwing.dynamics.vehicles.propeller import drag_coefficients

    profile, induced = drag_coefficients(drone.propeller)
    pitch_speed = 300.0 / (2 * math.pi) * drone.propeller.pitch
    static, total = both(drone, situation(velocity=(0, 0, 0.3 * pitch_speed)))
    expected = (profile + induced * 0.7**2) / (profile + induced)
    assert np.array(total.torque) / static.torque == pytest.approx(expected)


def test_slope_against_blade_elements(drone, situation):
    """A blade of constant pitch H, integrated over its radius, loses V / (n H) of its thrust to first order."""
    radius, pitch, climb, n = 0.2794, 0.18796, 0.5, 300.0 / (2 * math.pi)

    def lift(r, v):
        return (math.atan(pitch / (2 * math.pi * r)) - math.atan(v / (2 * math.pi * n * r))) * r**2

    loss = 1 - quad(lift, 0.05, radius, (climb,))[0] / quad(lift, 0.05, radius, (0.0,))[0]
    static, total = both(drone, situation(velocity=(0, 0, climb)))
    assert 1 - total.thrust[0] / static.thrust[0] == pytest.approx(loss, rel=0.1)


def test_only_axial_air_speed_counts(drone, situation):
    static, total = both(drone, situation(velocity=(4, 1, 2), wind=(0, 1, 2)))
    assert total.thrust == pytest.approx(static.thrust)
    static, total = both(drone, situation(velocity=(2, 0, 0), turn=(0, math.pi / 2, 0)))  # body z is world x
    assert total.thrust[0] < static.thrust[0]


def test_rotor_at_rest_has_no_loads(drone, situation):
    _, total = both(drone, situation(velocity=(0, 0, -3), speed=(0, 0, 0, 0)))
    assert total == ((0.0,) * 4, (0.0,) * 4)


def test_rolling_and_pitching_are_damped_by_hub_speeds(drone, situation):
    """In pure rotation each rotor at (x, y) has the loads of a climb at omega_x y - omega_y x."""
    omega = (0.4, -0.3, 0.8)
    _, turning = both(drone, situation(omega=omega))
    for k, (x, y, _) in enumerate(drone.rotors.position):
        _, climbing = both(drone, situation(velocity=(0.0, 0.0, omega[0] * y - omega[1] * x)))
        assert turning.thrust[k] == pytest.approx(climbing.thrust[k])
        assert turning.torque[k] == pytest.approx(climbing.torque[k])


def test_damping_of_roll_is_slope_of_thrust_over_inertia(drone):
    tables = {"rotor_thrust": {}, "axial_inflow": {}}
    p = multirotor.parameters(drone, effects.from_scene(tables, drone))
    state = multirotor.initial_state(p, (0.0, 0.0, 20.0), rotor_speed=335.0, omega_body=(0.1, 0.0, 0.0))
    result = multirotor.observe(p, 0, 0.004, state, (32.0,) * 4).angular_acceleration_body[0] / -0.1
    inflow = p.effects[0]
    slope = inflow.thrust_constant * STANDARD_DENSITY * 335.0 * inflow.turn_per_metre  # [N s/m] of a rotor
    assert result == pytest.approx(slope * sum(y * y for _, y, _ in drone.rotors.position) / drone.mass.inertia[0])
    assert result == pytest.approx(4.5, abs=0.2)
