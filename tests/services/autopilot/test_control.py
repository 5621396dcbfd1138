import math

import numpy as np
import pytest
from closed_loop import AIRFRAME, NOMINAL, TICK, mission, rmse

from lapwing.dynamics.lie.quaternion import NO_ROTATION, from_roll_pitch_yaw
from lapwing.services.autopilot.control import START, step
from lapwing.services.autopilot.controller_parameters import build
from lapwing.services.autopilot.gains import load
from lapwing.services.autopilot.land_detector import LANDED
from lapwing.services.common.ports import Setpoint, StateEstimate

TABLE_7 = np.array([0.2373, 0.2700, 0.0981, 0.0334, 0.0277, 0.0220])  # x, y, z [m], roll, pitch, yaw [rad]
ZERO = (0.0, 0.0, 0.0)
HIGH = (0.0, 0.0, 10.0)
SETS = pytest.mark.parametrize("name", ["paper", "tuned"])
LOOPS = pytest.mark.parametrize("geometric", [False, True])


def command(name, setpoint=HIGH, attitude=NO_ROTATION, yaw=0.0, geometric=False, ticks=20, omega=ZERO):
    p, s = build(load(name), AIRFRAME, geometric), START
    for _ in range(ticks):
        s, u = step(p, s, TICK, StateEstimate(HIGH, attitude, ZERO, omega), Setpoint(setpoint, ZERO, ZERO, yaw, 0.0), 0)
    return u


def torque(thrust):
    a = AIRFRAME
    return np.array(
        [np.dot(a.rotor_y, thrust), -np.dot(a.rotor_x, thrust), a.torque_per_thrust * np.dot(a.reaction_sign, thrust)]
    )


def test_thrust_at_setpoint_is_weight_with_feed_forward():
    assert sum(command("tuned").thrust) == pytest.approx(AIRFRAME.mass * AIRFRAME.gravity, rel=1e-12)
    assert sum(command("paper").thrust) == 0.0


@SETS
@LOOPS
@pytest.mark.parametrize("heading", [0.0, math.pi / 2, -2.5])
@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.0, 1.0)])
def test_position_error_tilts_thrust_at_any_heading(name, geometric, heading, direction):
    dx, dy = direction
    attitude = from_roll_pitch_yaw(0.0, 0.0, heading)
    u = command(name, (0.2 * dx, 0.2 * dy, 10.1), attitude, heading, geometric, ticks=60)
    q = from_roll_pitch_yaw(u.roll_reference, u.pitch_reference, heading)
    w, x, y, z = q
    thrust_world = np.array([2.0 * (x * z + w * y), 2.0 * (y * z - w * x)])
    assert thrust_world @ (dx, dy) > 0.05
    assert abs(thrust_world @ (-dy, dx)) < 5e-3
    # The first torque turns the body towards that reference.
    first = torque(command(name, (0.2 * dx, 0.2 * dy, 10.1), attitude, heading, geometric, ticks=1).thrust)
    assert first[0] * u.roll_reference >= -1e-9
    assert first[1] * u.pitch_reference >= -1e-9
    assert np.abs(first[:2]).max() > 1e-3


@SETS
@LOOPS
def test_torque_opposes_tilt_yaw_error_and_rates(name, geometric):
    def reaction(angles=ZERO, omega=ZERO):
        return torque(command(name, (0.0, 0.0, 10.1), from_roll_pitch_yaw(*angles), 0.0, geometric, 1, omega).thrust)

    for axis in range(3):
        error_angles = tuple(0.02 if k == axis else 0.0 for k in range(3))
        assert reaction(angles=error_angles)[axis] < -1e-3
        assert reaction(omega=error_angles)[axis] < -1e-3


def test_yaw_error_wraps_at_180_degrees():
    u = command("tuned", attitude=from_roll_pitch_yaw(0.0, 0.0, 3.1), yaw=-3.1, ticks=1)
    assert torque(u.thrust)[2] > 0.0


def test_saturated_thrusts_stay_in_range():
    top = build(load("paper"), AIRFRAME).thrust_max
    rng = np.random.default_rng(5)
    for name in ("paper", "tuned"):
        for _ in range(50):
            u = command(
                name,
                tuple(rng.normal(0.0, 30.0, 3)),
                from_roll_pitch_yaw(*rng.normal(0.0, 0.5, 3)),
                rng.normal(),
                ticks=3,
            )
            assert min(u.thrust) >= 0.0
            assert max(u.thrust) <= top
            assert max(u.motor_voltage) <= AIRFRAME.voltage_max * (1.0 + 1e-12)


@LOOPS
def test_paper_gains_reproduce_table_7(geometric):
    log = mission(build(load("paper"), AIRFRAME, geometric))
    assert log[-1, 14] == LANDED
    assert rmse(log)[:3] == pytest.approx(TABLE_7[:3], rel=0.25)


@LOOPS
@pytest.mark.parametrize("delay", [0, 1])
def test_tuned_flies_mission_ten_times_better_on_truth(geometric, delay):
    p = build(load("tuned"), AIRFRAME, geometric)
    for seed in range(3):
        log = mission(p, NOMINAL._replace(delay=delay), seed)
        assert log[-1, 14] == LANDED
        assert (rmse(log) < 0.1 * TABLE_7).all()


def test_tuned_gains_tolerate_wrong_mass_inertia_and_thrust():
    p = build(load("tuned"), AIRFRAME)
    for mass in (0.8, 1.2):
        for inertia in (0.8, 1.2):
            for thrust in (0.8, 1.2):
                plant = NOMINAL._replace(
                    mass=mass * NOMINAL.mass,
                    inertia=tuple(inertia * i for i in NOMINAL.inertia),
                    thrust_coefficient=thrust * NOMINAL.thrust_coefficient,
                    delay=1,
                )
                log = mission(p, plant)
                assert log[-1, 14] == LANDED
                assert (rmse(log) < TABLE_7 / 3.0).all()


def test_tuned_gains_have_third_of_error_on_noisy_estimate():
    log = mission(build(load("tuned"), AIRFRAME), noise=(0.02, 0.05, 0.005, 0.02))
    assert (rmse(log) < TABLE_7 / 3.0).all()


@SETS
def test_flight_is_repeatable_bit_for_bit(name):
    p = build(load(name), AIRFRAME)
    assert mission(p, seed=3).tobytes() == mission(p, seed=3).tobytes()
    assert mission(p, seed=3).tobytes() != mission(p, seed=4).tobytes()
