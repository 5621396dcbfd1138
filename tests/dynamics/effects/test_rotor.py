"""Rotors: thrust, torques, drag, flapping, damage."""

import math

import numpy as np
import pytest
from effects_helpers import NO_FACTORS, NO_LOADS, rotation_of

from lapwing.dynamics import effects
from lapwing.dynamics.effects.gyroscopic_torque import gyroscopic_torque
from lapwing.dynamics.effects.h_force import h_force
from lapwing.dynamics.effects.rotational_drag import rotational_drag
from lapwing.dynamics.effects.rotor_damage import rotor_damage, strike
from lapwing.dynamics.effects.rotor_flapping import rotor_flapping
from lapwing.dynamics.effects.rotor_quadratic import rotor_quadratic
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


def drag(drone, s, rotors, linear=(0.1, 0.2, 0.3)):
    (e,) = effects.from_scene({"rotational_drag": {"linear": list(linear)}}, drone)
    return rotational_drag.py_func(e, (), s, rotors())


def test_torque_opposes_each_rate(drone, situation, rotors):
    s = situation(omega=(1.0, -2.0, 3.0))
    assert drag(drone, s, rotors) == pytest.approx((-0.1, 0.4, -0.9))


def test_negative_coefficient_is_rejected(drone):
    with pytest.raises(ValueError, match=r"effects.rotational_drag.linear"):
        effects.from_scene({"rotational_drag": {"linear": [0.1, -0.1, 0.1]}}, drone)


def test_damage_acts_on_one_rotor_from_its_time(drone, situation):
    (e,) = effects.from_scene(
        {"rotor_damage": {"rotor": 2, "time": 4.0, "remaining_thrust": 0.6, "remaining_torque": 1.1}}, drone
    )
    memory = strike.py_func(e, e.initial_discrete_state(), 3.99)
    assert rotor_damage.py_func(e, memory, situation(), NO_FACTORS) == NO_FACTORS
    memory = strike.py_func(e, memory, 4.0)
    hurt = rotor_damage.py_func(e, memory, situation(), NO_FACTORS)
    assert hurt == ((1.0, 0.6, 1.0, 1.0), (1.0, 1.1, 1.0, 1.0))


def test_missing_rotor_is_rejected(drone):
    with pytest.raises(
        ValueError, match=r"effects.rotor_damage.rotor: expected one of the vehicle's rotors, 1 to 4, got 5"
    ):
        effects.from_scene({"rotor_damage": {"rotor": 5}}, drone)


def test_torque_is_minus_change_of_rotors_momentum(drone, situation, rotors):
    """Rotor k turns at -sign_k w_k about body z: torque on the body -(L' + omega x L)."""
    (e,) = effects.from_scene({"gyroscopic_torque": {}}, drone)
    speed, acceleration = (300, 310, 280, 350), (50.0, -20.0, 70.0, 10.0)
    omega = np.array([0.3, -0.7, 1.1])
    torque = gyroscopic_torque.py_func(e, (), situation(omega=omega, speed=speed), rotors(acceleration=acceleration))
    axis = -np.array([1, -1, 1, -1]) * 8.6e-4
    momentum, change = np.array([0, 0, axis @ speed]), np.array([0, 0, axis @ acceleration])
    assert torque == pytest.approx(-(change + np.cross(omega, momentum)), rel=1e-12)


def test_equal_rotors_cancel(drone, situation, rotors):
    (e,) = effects.from_scene({"gyroscopic_torque": {}}, drone)
    torque = gyroscopic_torque.py_func(e, (), situation(omega=(1, 2, 3)), rotors())
    assert torque == pytest.approx((0, 0, 0), abs=1e-15)


def test_force_is_sum_over_rotors(drone, situation, rotors):
    """Each rotor contributes -rho c w (v + omega x r) in its plane, at r."""
    lifted = drone.model_copy(
        update={
            "rotors": drone.rotors.model_copy(
                update={"position": tuple((x, y, 0.1) for x, y, _ in drone.rotors.position)}
            )
        }
    )
    (e,) = effects.from_scene({"h_force": {"coefficient": 1e-4}}, lifted)
    speed, omega = np.array([300.0, 250, 320, 280]), np.array([0.3, -0.5, 0.8])
    s = situation(velocity=(6, -2, 1), wind=(1, 1, 0), turn=(0.1, 0.2, -0.4), omega=omega, speed=speed)
    v = rotation_of(s).T @ np.array([5.0, -3, 1])
    force, torque = np.zeros(3), np.zeros(3)
    for w, r in zip(speed, lifted.rotors.position, strict=True):
        f = -1.2 * 1e-4 * w * (v + np.cross(omega, r)) * [1, 1, 0]
        force, torque = force + f, torque + np.cross(r, f)
    result = h_force.py_func(e, (), s, rotors())
    assert result[0] == pytest.approx(force, rel=1e-12)
    assert result[1] == pytest.approx(torque, rel=1e-12)


def test_default_coefficient_is_h_force_of_blade_element_theory(drone):
    """C_H = sigma c_d mu / 4, with thrust-coefficient scaling rho A (w R)^2."""
    (e,) = effects.from_scene({"h_force": {}}, drone)
    radius, chord = 0.2794, 0.5588 / 5
    solidity = 2 * chord / (np.pi * radius)
    drag = 0.015 + np.pi * 5 * 6.11**2 / 0.83 * (0.85 * np.arctan(7.4 / (np.pi * 22)) / (np.pi * 5 + 6.11)) ** 2
    expected = np.pi * radius**2 * radius**2 * solidity * drag / 4 / radius
    assert e.coefficient == pytest.approx(expected, rel=1e-4)


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
