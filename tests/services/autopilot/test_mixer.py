import numpy as np
import pytest
from closed_loop import AIRFRAME
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from lapwing.services.autopilot.controller_parameters import build
from lapwing.services.autopilot.gains import load
from lapwing.services.autopilot.mixer import AIRMODE_ROLL_PITCH, VirtualControls, mix, saturate

SHARES = build(load("paper"), AIRFRAME).shares[0]
TOP = 48.0
ANY = st.floats(-100.0, 100.0)


def wrench(thrust):
    """Return the total force and torque of the rotors by cross products of their positions."""
    force, torque = np.zeros(3), np.zeros(3)
    for f, x, y, turn in zip(thrust, AIRFRAME.rotor_x, AIRFRAME.rotor_y, AIRFRAME.reaction_sign, strict=True):
        force += (0.0, 0.0, f)
        torque += np.cross((x, y, 0.0), (0.0, 0.0, f))
        torque[2] += turn * AIRFRAME.torque_per_thrust * f
    return force, torque


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_virtual_controls_are_decoupled(axis):
    demands = [0.0, 0.0, 0.0, 0.0]
    demands[1 + axis] = 2.0
    force, torque = wrench(mix(SHARES, VirtualControls(*demands)))
    arm = (AIRFRAME.rotor_y[0], AIRFRAME.rotor_x[0], AIRFRAME.torque_per_thrust)[axis]
    assert force == pytest.approx(0.0, abs=1e-12)
    assert torque == pytest.approx([8.0 * arm if k == axis else 0.0 for k in range(3)], abs=1e-12)


def test_lift_causes_no_torque():
    force, torque = wrench(mix(SHARES, VirtualControls(3.0, 0.0, 0.0, 0.0)))
    assert force == pytest.approx((0.0, 0.0, 12.0))
    assert torque == pytest.approx(0.0, abs=1e-12)


@given(ANY, ANY, ANY, ANY)
@settings(deadline=None)
@example(2.0, -2.0, -2.0, -2.0)  # only this yaw is feasible: the collective makes room for the tilt alone
def test_saturation_keeps_feasible_thrusts(collective, roll, pitch, yaw):
    expected = VirtualControls(collective, roll, pitch, yaw)
    given_ = saturate(SHARES, expected, TOP, AIRMODE_ROLL_PITCH)
    thrust = mix(SHARES, given_)
    assert min(thrust) >= -1e-9
    assert max(thrust) <= TOP + 1e-9
    free = mix(SHARES, expected) + mix(SHARES, expected._replace(yaw=0.0))
    if min(free) >= 0.0 and max(free) <= TOP:
        assert given_ == pytest.approx(expected, abs=1e-12)
    assert all(abs(a) <= abs(b) + 1e-12 and a * b >= 0.0 for a, b in zip(given_[1:], expected[1:], strict=True))


@given(st.floats(0.0, 48.0), st.floats(-12.0, 12.0), st.floats(-12.0, 12.0), ANY)
@settings(deadline=None)
def test_yaw_gets_remaining_range(collective, roll, pitch, yaw):
    given_ = saturate(SHARES, VirtualControls(collective, roll, pitch, yaw), TOP, AIRMODE_ROLL_PITCH)
    assert given_[1:3] == pytest.approx((roll, pitch), abs=1e-12)
    bare = mix(SHARES, given_._replace(yaw=0.0))
    shares = [s[3] for s in SHARES]
    best = linprog(  # the largest yaw towards the desired one with feasible thrusts
        [-np.sign(yaw) or -1.0],
        A_ub=[[s] for s in shares] + [[-s] for s in shares],
        b_ub=[max(TOP - b, 0.0) for b in bare] + [max(b, 0.0) for b in bare],
        bounds=[(min(yaw, 0.0), max(yaw, 0.0))],
    )
    assert given_.yaw == pytest.approx(best.x[0], abs=1e-6)
