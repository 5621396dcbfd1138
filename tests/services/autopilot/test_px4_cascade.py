"""PX4's cascade: closed forms of its blocks, hover, flights with PX4's default gains, and gains changed in flight."""

import math
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lapwing
from lapwing.cosim.scene import SceneError
from lapwing.dynamics.lie.quaternion import NO_ROTATION, exp, from_roll_pitch_yaw, multiply, rotate, to_roll_pitch_yaw
from lapwing.dynamics.vector import ZERO, norm, scale
from lapwing.services.autopilot import controller_parameters
from lapwing.services.autopilot.motor import thrust_at
from lapwing.services.autopilot.nominal_airframe import known_airframe
from lapwing.services.autopilot.px4 import attitude, law, position, rates
from lapwing.services.common.autopilot_parameters import table
from lapwing.services.common.ports import Setpoint, StateEstimate
from lapwing.services.scene_resolver import load
from tests.cosim import memory_log
from tests.services.autopilot.flights import command

PX4 = 'autopilot.controller="px4"'
ACCELERATION = st.tuples(*[st.floats(-4.0, 4.0)] * 3)
TUNING_PAGE = (  # requested by QGroundControl's PID Tuning page of a multicopter
    "MC_ROLLRATE_K MC_ROLLRATE_P MC_ROLLRATE_I MC_ROLLRATE_D MC_PITCHRATE_K MC_PITCHRATE_P MC_PITCHRATE_I "
    "MC_PITCHRATE_D MC_YAWRATE_K MC_YAWRATE_P MC_YAWRATE_I MC_ROLL_P MC_PITCH_P MC_YAW_P MPC_XY_P MPC_Z_P "
    "MPC_XY_VEL_P_ACC MPC_XY_VEL_I_ACC MPC_XY_VEL_D_ACC MPC_Z_VEL_P_ACC MPC_Z_VEL_I_ACC MPC_Z_VEL_D_ACC"
)


def parameters(scene="quad_x", **changed):
    loaded = load(scene, [PX4])
    values = {p.name: p.default for p in table(loaded).values()} | changed
    return law.build(values, known_airframe(loaded))


P = parameters()


def test_every_gain_of_tuning_page_has_px4_default():
    px4_table = table(load("quad_x", [PX4]))
    assert set(TUNING_PAGE.split()) <= set(px4_table)
    assert not [name for name in px4_table if name.startswith("PID_")]
    assert [px4_table[name].default for name in ("MC_ROLLRATE_P", "MC_YAWRATE_I", "MPC_Z_VEL_P_ACC")] == [
        0.15,
        0.1,
        4.0,
    ]
    assert "MC_ROLLRATE_P" not in table(load("quad_x"))


@given(ACCELERATION)
@settings(deadline=None)
def test_thrust_points_along_acceleration_and_gravity(a):
    p = P.position._replace(thrust_min=0.0, thrust_max=9.0)
    thrust = position.thrust_setpoint(p, a)
    assert scale(1.0 / thrust[2], thrust) == pytest.approx((a[0] / p.gravity, a[1] / p.gravity, 1.0), abs=1e-9)
    assert thrust[2] == pytest.approx(p.hover * (1.0 + a[2] / p.gravity), rel=1e-9)


def test_tilt_and_collective_keep_their_limits():
    x, y, z = position.thrust_setpoint(P.position._replace(thrust_max=2.0), (30.0, 40.0, 0.0))
    assert math.hypot(x, y) / z == pytest.approx(math.tan(P.position.tilt))
    assert (x / math.hypot(x, y), y / math.hypot(x, y)) == pytest.approx((0.6, 0.8))
    x, y, z = position.thrust_setpoint(P.position, (5.0, 0.0, 50.0))
    assert norm((x, y, z)) == pytest.approx(1.0)
    assert x == pytest.approx(P.position.margin_xy)  # reserved for the horizontal component
    assert norm(position.thrust_setpoint(P.position, (0.0, 0.0, -20.0))) == pytest.approx(P.position.thrust_min)


def test_position_error_has_priority_over_feed_forward_velocity():
    assert position.limit_horizontal(3.0, 0.0, 0.0, 9.0, 5.0) == pytest.approx((3.0, 4.0))
    assert position.limit_horizontal(6.0, 8.0, 1.0, 1.0, 5.0) == pytest.approx((3.0, 4.0))
    assert position.limit_horizontal(1.0, 0.0, 1.0, 0.5, 5.0) == (2.0, 0.5)


@given(st.tuples(*[st.floats(-0.4, 0.4)] * 2), st.floats(-3.0, 3.0))
@settings(deadline=None)
def test_attitude_setpoint_has_thrust_axis_and_yaw(tilt, yaw):
    thrust = (tilt[0], tilt[1], 1.0)
    q = attitude.attitude_setpoint(thrust, yaw)
    assert rotate(q, (0.0, 0.0, 1.0)) == pytest.approx(scale(1.0 / norm(thrust), thrust), abs=1e-9)
    across = rotate(q, (1.0, 0.0, 0.0))[0] * -math.sin(yaw) + rotate(q, (1.0, 0.0, 0.0))[1] * math.cos(yaw)
    assert across == pytest.approx(0.0, abs=1e-9)  # body x is in the vertical plane of the heading


def test_rate_setpoint_is_gain_times_small_attitude_error():
    now = from_roll_pitch_yaw(0.1, -0.2, 0.7)
    for axis in range(3):
        turn = [0.0, 0.0, 0.0]
        turn[axis] = 1e-4
        result = attitude.rate_setpoint(P.attitude, now, multiply(now, exp(tuple(turn))), 0.0)
        assert result[axis] == pytest.approx(P.attitude.gain[axis] * 1e-4, rel=1e-3)


def test_yaw_weight_scales_rotation_about_thrust_axis_only():
    desired = multiply(from_roll_pitch_yaw(0.5, 0.0, 0.0), from_roll_pitch_yaw(0.0, 0.0, 1.0))
    result = attitude.weighted_setpoint(NO_ROTATION, desired, 0.4)
    assert rotate(result, (0.0, 0.0, 1.0)) == pytest.approx(rotate(desired, (0.0, 0.0, 1.0)), abs=1e-12)
    assert to_roll_pitch_yaw(multiply(from_roll_pitch_yaw(-0.5, 0.0, 0.0), result))[2] == pytest.approx(0.4, abs=1e-9)
    whole = attitude.weighted_setpoint(NO_ROTATION, desired, 1.0)
    assert whole == pytest.approx(desired, abs=1e-12)


def test_upside_down_vehicle_turns_at_rate_limit():
    over = attitude.rate_setpoint(P.attitude, from_roll_pitch_yaw(math.pi, 0.0, 0.0), NO_ROTATION, 0.0)
    assert abs(over[0]) == pytest.approx(math.radians(220.0))


def test_rate_loop_is_pid_with_scale_and_feed_forward():
    p = parameters(MC_ROLLRATE_K=2.0, MC_ROLLRATE_FF=0.05).rates
    torque = rates.torque_setpoint(p, (1.0, 0.0, 0.0), (0.4, 0.0, 0.0), (5.0, 0.0, 0.0), (0.02, 0.0, 0.0))
    assert torque[0] == pytest.approx(2.0 * 0.15 * 0.6 + 0.02 - 2.0 * 0.003 * 5.0 + 0.05)
    grown = rates.rate_integral(p, ZERO, (0.1, 0.1, 0.1), (0.0, 1.0, -1.0), 0.01)
    less = 1.0 - (0.1 / math.radians(400.0)) ** 2
    assert grown == pytest.approx((2.0 * 0.2 * 0.1 * 0.01 * less, 0.0, 0.1 * 0.1 * 0.01 * less))
    assert rates.rate_integral(p, (0.3, 0.0, 0.0), (1.0, 0.0, 0.0), ZERO, 1.0)[0] == 0.3


@pytest.mark.parametrize("model", [0.0, 0.3, 1.0])
def test_motor_signal_inverts_px4_thrust_model(model):
    for thrust in (0.0, 0.3, 1.0):
        u = law.signal(model, thrust)
        assert model * u * u + (1.0 - model) * u == pytest.approx(thrust)


def test_normalised_torque_of_x_quadrotor_uses_root_two():
    frame = known_airframe(load("hover"))
    x, y, z = law.normalisation(frame)
    assert (x, y, z) == pytest.approx((math.sqrt(0.5), math.sqrt(0.5), 1.0), rel=1e-6)


@pytest.mark.parametrize("model", [0.0, 0.5])
@pytest.mark.parametrize("scene", ["quad_x", "hover", "hexacopter"])
def test_thrust_carries_weight_at_rest(scene, model):
    p, frame = parameters(scene, THR_MDL_FAC=model), known_airframe(load(scene))
    place = (0.0, 0.0, 5.0)
    estimate = StateEstimate(position_world=place)
    _, result = law.step(p, law.start(estimate), 0.004, estimate, Setpoint(position_world=place), 0)
    mean = controller_parameters.lift(frame) / len(frame.rotor_x)
    assert sum(result.thrust) * mean == pytest.approx(frame.mass * frame.gravity, rel=0.02)
    assert max(result.motor_voltage) < p.voltage_max
    assert result.thrust[0] == pytest.approx(thrust_at(frame.motor, result.motor_voltage[0]))


def test_hover_thrust_is_parameter_without_its_estimate():
    assert parameters(MPC_USE_HTE=0.0, MPC_THR_HOVER=0.6).position.hover == 0.6
    assert P.position.hover == pytest.approx(0.72, abs=0.02)  # of the Iris


def fly_px4(scene, *overrides, script=lambda tick: ()):
    return memory_log.fly(load(scene, [PX4, *overrides]), script)


@pytest.mark.long
def test_default_gains_fly_iris_along_its_square():
    flight = lapwing.fly("quad_x", [PX4])
    assert flight.landed
    assert max(flight.rmse[axis] for axis in "xyz") < 0.2  # [m]
    assert max(flight.rmse[axis] for axis in ("roll", "pitch", "yaw")) < 0.1  # [rad]


@pytest.mark.long
def test_default_gains_fly_delivery_mission():
    flight = lapwing.fly("delivery_mission", [PX4])
    assert flight.landed
    assert max(flight.rmse[axis] for axis in "xyz") < 0.2


@pytest.mark.long
def test_hover_returns_from_offset():
    """The response to a step of 1 m in each axis decays: no loop oscillates."""
    sets = ["autopilot.accept_commands=true", "autopilot.follow_trajectory=false", "run.duration=30"]
    script = {
        10: [command("takeoff", 4.0), command("arm", math.nan, 10.0)],
        2500: [command("goto", 1.0, 1.0, 5.0, 0.5)],
    }
    flight = fly_px4("hover", *sets, script=lambda tick: script.get(tick, ()))
    path = np.array(flight.column("ground_truth", lambda m: tuple(m.pose.position)))
    assert np.ptp(path[-200:], axis=0) == pytest.approx(0.0, abs=0.02)
    assert path[-1][:2] == pytest.approx((1.0, 1.0), abs=0.05)


@pytest.mark.long
def test_run_command_flies_px4_cascade(tmp_path):
    log = tmp_path / "px4.mcap"
    run = [sys.executable, "-m", "lapwing", "run", "hover", "--mode", "single-process", "--log", str(log), "--set", PX4]
    result = subprocess.run(run, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    values = subprocess.run([sys.executable, "-m", "lapwing", "parameters", str(log)], capture_output=True, text=True)
    assert "MC_ROLLRATE_P" in values.stdout


def test_px4_controller_rejects_options():
    with pytest.raises(SceneError, match="controller_options"):
        load("hover", [PX4, "autopilot.controller_options.gain=1.0"])
