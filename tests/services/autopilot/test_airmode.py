"""MC_AIRMODE: priorities under saturation against linear programs, and rotor torques at zero throttle."""

import math

import numpy as np
import pytest
from flights import ACCEPTED, UP, at, command, fly, results
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from test_allocation import ROTORS
from test_mixer import SHARES, wrench

from lapwing.dynamics.lie.quaternion import from_roll_pitch_yaw
from lapwing.dynamics.vector import ZERO
from lapwing.services.autopilot import control
from lapwing.services.autopilot.allocation import tables
from lapwing.services.autopilot.commander_block import controller
from lapwing.services.autopilot.mixer import (
    AIRMODE_DISABLED,
    AIRMODE_ROLL_PITCH,
    AIRMODE_ROLL_PITCH_YAW,
    VirtualControls,
    airmode,
    mix,
    saturate,
)
from lapwing.services.common.autopilot_parameters import table
from lapwing.services.common.ports import Setpoint, StateEstimate
from lapwing.services.scene_resolver import load, resolve

TOP = 10.0  # [N]
ANY = st.floats(-30.0, 30.0)
TABLES = st.sampled_from([tables(B)[-1] for B in ROTORS.values()])
ALL = AIRMODE_DISABLED, AIRMODE_ROLL_PITCH, AIRMODE_ROLL_PITCH_YAW


def largest(shares, q, mode):
    """Return the feasible parts of roll and pitch, and of yaw, by a linear program for each priority."""
    s, c = np.array(shares), max(q.collective, 0.0)
    bounds = (None, None) if mode else (0.0, c)

    def solve(objective, columns, limits):
        A = np.column_stack([s[:, 0], *columns])
        b = np.concatenate([np.full(len(s), TOP), np.zeros(len(s))])
        result = linprog(objective, np.vstack([A, -A]), b, bounds=[bounds, *limits])
        return result.x

    tilt, yaw = s[:, 1] * q.roll + s[:, 2] * q.pitch, s[:, 3] * q.yaw
    _, part = solve([0.0, -1.0], [tilt], [(0.0, 1.0)])
    results = (solve([0.0, 0.0, -1.0], [tilt, yaw], [(part - slack, part), (0.0, 1.0)]) for slack in (1e-9, 1e-6))
    *_, turn = next(x for x in results if x is not None)  # the solver's tolerance is 1e-7
    return part, turn


@given(ANY, ANY, ANY, ANY, TABLES, st.sampled_from(ALL))
@settings(deadline=None)
def test_every_airmode_keeps_motor_limits_and_signs(collective, roll, pitch, yaw, shares, mode):
    q = VirtualControls(collective, roll, pitch, yaw)
    result = saturate(shares, q, TOP, mode)
    thrust = mix(shares, result)
    assert min(thrust) >= -1e-9
    assert max(thrust) <= TOP + 1e-9
    assert all(abs(a) <= abs(b) and a * b >= 0.0 for a, b in zip(result[1:], q[1:], strict=True))


@given(ANY, ANY, ANY, ANY, TABLES)
@settings(deadline=None)
def test_disabled_airmode_reduces_tilt_and_never_raises_collective(collective, roll, pitch, yaw, shares):
    q = VirtualControls(collective, roll, pitch, yaw)
    result = saturate(shares, q, TOP, AIRMODE_DISABLED)
    assert result.collective <= max(collective, 0.0) + 1e-12
    part, _ = largest(shares, q, AIRMODE_DISABLED)
    assert result[1:3] == pytest.approx((part * roll, part * pitch), abs=1e-6)
    usual = saturate(shares, q, TOP, AIRMODE_ROLL_PITCH)
    if usual.collective <= collective - 1e-9:
        assert result == usual


@given(ANY, ANY, ANY, ANY, TABLES)
@settings(deadline=None)
def test_airmode_for_yaw_keeps_tilt_before_yaw_before_collective(collective, roll, pitch, yaw, shares):
    q = VirtualControls(collective, roll, pitch, yaw)
    result = saturate(shares, q, TOP, AIRMODE_ROLL_PITCH_YAW)
    part, turn = largest(shares, q, AIRMODE_ROLL_PITCH_YAW)
    if not any(s[3] for s in shares):
        turn = 1.0  # any value: without yaw shares it has no effect
    expected = (part * roll, part * pitch, turn * yaw)
    assert result[1:] == pytest.approx(expected, abs=1e-5)
    bare = np.array(mix(shares, result._replace(collective=0.0)))
    lift = np.array([s[0] for s in shares])
    low, high = (-bare / np.where(lift, lift, np.inf)).max(), ((TOP - bare) / np.where(lift, lift, 1e-12)).min()
    assert result.collective == pytest.approx(np.clip(collective, low, max(low, high)), abs=1e-6)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_airmode_sets_axes_with_torque_at_zero_throttle(sign):
    def torques(q, mode):
        force, torque = wrench(mix(SHARES, saturate(SHARES, q, TOP, mode)))
        return force[2], *torque

    turning, rolling = VirtualControls(0.0, 0.0, 0.0, sign * 2.0), VirtualControls(0.0, sign * 2.0, 0.0, 0.0)
    for mode in (AIRMODE_DISABLED, AIRMODE_ROLL_PITCH):
        assert torques(turning, mode) == pytest.approx((0.0, 0.0, 0.0, 0.0), abs=1e-12)
    lift, *tilt, yaw = torques(turning, AIRMODE_ROLL_PITCH_YAW)
    assert lift == pytest.approx(8.0)
    assert tilt == pytest.approx([0.0, 0.0], abs=1e-12)
    assert yaw * sign > 0.0
    assert yaw == pytest.approx(wrench(mix(SHARES, turning))[1][2])
    assert torques(rolling, AIRMODE_DISABLED) == pytest.approx((0.0, 0.0, 0.0, 0.0), abs=1e-12)
    for mode in (AIRMODE_ROLL_PITCH, AIRMODE_ROLL_PITCH_YAW):
        lift, roll, *_ = torques(rolling, mode)
        assert lift == pytest.approx(8.0)
        assert roll == pytest.approx(wrench(mix(SHARES, rolling))[1][0])


def test_default_airmode_is_roll_pitch():
    assert airmode({}) == AIRMODE_ROLL_PITCH
    assert [airmode({"MC_AIRMODE": float(k)}) for k in range(3)] == list(ALL)


def tumbling(roll):
    """Return the estimate of a rolling vehicle far above its setpoint, and the setpoint: no lift is desired."""
    estimate = StateEstimate(
        position_world=(0.0, 0.0, 80.0),
        velocity_world=(0.0, 0.0, 5.0),
        attitude=from_roll_pitch_yaw(roll, 0.0, 0.0),
        omega_body=(roll, 0.0, 0.0),
    )
    return estimate, Setpoint((0.0, 0.0, 2.0), ZERO, ZERO, 0.0, 0.0)


@pytest.mark.parametrize("roll", [0.3, -0.3])
def test_cascaded_pid_raises_lift_for_roll_unless_disabled(roll):
    scene = load("hover")
    values = {p.name: p.default for p in table(scene).values()}
    config = resolve(scene).services["autopilot"].parameters
    estimate, setpoint = tumbling(roll)

    def thrusts(mode):
        law = controller(config, values | {"MC_AIRMODE": mode})
        return control.step(law, control.START, 0.004, estimate, setpoint, 0)[1].thrust

    assert thrusts(0.0) == pytest.approx([0.0] * 4, abs=1e-9)
    force, torque = wrench(thrusts(1.0))
    assert force[2] > 1.0
    assert torque[0] * roll < 0.0
    assert thrusts(2.0) == pytest.approx(thrusts(1.0))  # no yaw is desired


@pytest.mark.long
def test_airmode_is_changed_in_flight():
    """Free fall with an oscillating desired pitch."""

    def fall(*angles):
        steps = enumerate(angles)
        pitches = {6.0 + 0.1 * k: (math.cos(0.5 * a), 0.0, math.sin(0.5 * a), 0.0) for k, a in steps}
        return {t: [command("offboard_attitude", *q, *[math.nan] * 3, 0.0)] for t, q in pitches.items()}

    def lift(mode):
        enter = {5.9: [command("parameter", mode, text="MC_AIRMODE", id=1)], 6.04: [command("offboard", id=2)]}
        flight = fly(6.6, UP | enter | fall(0.0, 0.3, -0.3, 0.3, -0.3))
        assert [results(flight)[k] for k in (1, 2)] == [ACCEPTED, ACCEPTED]
        return max(at(flight, "actuators", t, lambda m: math.fsum(m.thrust)) for t in np.arange(6.2, 6.6, 0.02))

    assert lift(0) < 0.2 * lift(1)
    assert lift(2) >= lift(1)
