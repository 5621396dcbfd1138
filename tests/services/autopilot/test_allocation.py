"""Control allocation for any set of rotors: identities on the effectiveness matrix, and priorities under saturation."""

import numpy as np
import pytest
from closed_loop import AIRFRAME
from hypothesis import example, given, settings
from hypothesis import strategies as st

from lapwing.services.autopilot import controller_parameters
from lapwing.services.autopilot.allocation import (
    effectiveness,
    rotor_shares,
    tables,
    tables_for_failures,
    tilted_effectiveness,
    virtual_control_effectiveness,
)
from lapwing.services.autopilot.mixer import AIRMODE_ROLL_PITCH, VirtualControls, mix, saturate

TOP, YAW = 10.0, 0.02  # [N], [m]
HALF = 0.5 * np.pi


def ring(angles, spins, radius=0.3):
    """Return the effectiveness of rotors on a circle."""
    x, y = radius * np.cos(angles), radius * np.sin(angles)
    return effectiveness(tuple(x), tuple(y), tuple(YAW * np.array(spins)))


def circle(count, start=0.0):
    return start - 2.0 * np.pi * np.arange(count) / count


HEXA_X = ring(circle(6, np.pi / 6), [1, 1, -1, -1, 1, -1])
ROTORS = {
    "quad +": ring(circle(4), [1, -1, 1, -1]),
    "quad, long": effectiveness((0.4, -0.4, -0.4, 0.4), (0.2, 0.2, -0.2, -0.2), (YAW, -YAW, YAW, -YAW)),
    "quad off its centre": effectiveness((0.25, -0.15, -0.15, 0.25), (0.2, 0.22, -0.18, -0.2), (YAW, -YAW, YAW, -YAW)),
    "hexa +": ring(circle(6), [1, -1, 1, -1, 1, -1]),
    "hexa X": HEXA_X,
    "octa": ring(circle(8, np.pi / 8), [1, -1] * 4),
    "X8, coaxial": ring(np.repeat(circle(4, np.pi / 4), 2), [1, -1, -1, 1, 1, -1, -1, 1]),
    "hexa, tilted": tilted_effectiveness(
        tuple((0.3 * np.cos(a), 0.3 * np.sin(a), 0.05) for a in circle(6)),
        tuple((-0.3 * s * np.sin(a), 0.3 * s * np.cos(a), 0.95) for a, s in zip(circle(6), [1, -1] * 3, strict=True)),
        (YAW, -YAW) * 3,
    ),
    "Y6, coaxial": ring(np.repeat(circle(3, np.pi / 3), 2), [1, -1] * 3),
}


@pytest.mark.parametrize("name", ROTORS)
def test_allocation_times_effectiveness_is_identity(name):
    B = ROTORS[name]
    result = B @ np.array(rotor_shares(B))
    assert result == pytest.approx(np.diag(virtual_control_effectiveness(B)), abs=1e-12)


def test_allocation_is_least_squares_solution():
    B = ROTORS["octa"]
    expected = np.array([20.0, 0.3, -0.2, 0.05])
    assert np.array(rotor_shares(B)) @ (expected / virtual_control_effectiveness(B)) == pytest.approx(
        np.linalg.pinv(B) @ expected
    )


def test_cross_of_four_rotors_has_unit_shares():
    a = AIRFRAME
    signs = [(1.0, np.sign(y), -np.sign(x), s) for x, y, s in zip(a.rotor_x, a.rotor_y, a.reaction_sign, strict=True)]
    assert controller_parameters.shares(a) == (tuple(signs),)


@pytest.mark.parametrize("name", ["hexa X", "octa"])
def test_allocation_without_failed_rotor_keeps_lift_roll_pitch(name):
    B = ROTORS[name]
    for k, shares in enumerate(tables(B)[1:]):
        assert shares[k] == (0.0, 0.0, 0.0, 0.0)
        result = B @ np.array(shares) / virtual_control_effectiveness(B)[:, None]
        assert result[:3] == pytest.approx(np.eye(4)[:3], abs=1e-12)


def test_hexacopter_yaw_after_failures_is_as_published():
    """Du, Quan, Yang, Cai, J. Guidance, Control, and Dynamics 38 (2015) 978: with spin directions PNPNPN the vehicle is
    uncontrollable after the loss of any rotor, with PPNNPN it is controllable after the loss of one of the first four.
    """
    yaw = [any(share[3] for share in shares) for shares in tables(HEXA_X)[1:]]
    assert yaw == [True, True, True, True, False, False]
    assert not any(any(share[3] for share in shares) for shares in tables(ROTORS["hexa +"])[1:])


@pytest.mark.parametrize("name", ["quad +", "X8, coaxial", "Y6, coaxial"])
def test_no_failure_tables_without_redundant_rotor(name):
    assert len(tables(ROTORS[name])) == 1


@pytest.mark.parametrize(
    "B",
    [
        ring(circle(3), [1, -1, 1]),  # three rotors, four controls
        ring(circle(4), [1, 1, 1, 1]),  # yaw is coupled to lift
        effectiveness((0.3, 0.2, -0.3, 0.1), (0.0, 0.0, 0.0, 0.0), (YAW, -YAW, YAW, -YAW)),  # in a row
        effectiveness((0.3, 0.1, 0.1, 0.3), (0.2, 0.2, -0.2, -0.2), (YAW, -YAW, YAW, -YAW)),  # all in front
    ],
)
def test_unbalanced_rotors_are_rejected(B):
    with pytest.raises(ValueError, match="cannot be balanced; expected lift from each"):
        tables(B)


ANY = st.floats(-30.0, 30.0)


@pytest.mark.long
@example(
    6.0, 1.0, 4.0, 1.0, ((1.0, 1.0, -1.0, 1.0), (1.0, 1.0, 1.0, -1.0), (1.0, -1.0, 1.0, 1.0), (1.0, -1.0, -1.0, -1.0))
)  # feasible only with yaw
@given(ANY, ANY, ANY, ANY, st.sampled_from([tables(B)[-1] for B in ROTORS.values()]))
@settings(deadline=None, max_examples=300)
def test_roll_and_pitch_are_kept_before_lift_and_lift_before_yaw(collective, roll, pitch, yaw, shares):
    expected = VirtualControls(collective, roll, pitch, yaw)
    result = saturate(shares, expected, TOP, AIRMODE_ROLL_PITCH)
    thrust = np.array(mix(shares, result))
    assert thrust.min() >= -1e-9
    assert thrust.max() <= TOP + 1e-9

    def possible(q):
        requested = [np.dot(share, q) for share in shares]
        return min(requested) >= -1e-9 and max(requested) <= TOP + 1e-9

    tilt = np.array([(s[1] * roll + s[2] * pitch, s[0]) for s in shares if s[0] > 0.0])
    lifts = (-tilt[:, 0] / tilt[:, 1]).max(), ((TOP - tilt[:, 0]) / tilt[:, 1]).min()
    if lifts[0] <= lifts[1]:  # a feasible collective leaves room for all of roll and pitch
        assert result[1:3] == (roll, pitch)
        assert result.collective == pytest.approx(np.clip(collective, *lifts), abs=1e-9)
    else:
        more = result._replace(roll=1.001 * result.roll, pitch=1.001 * result.pitch, yaw=0.0)
        tried = np.linspace(0.0, 4.0 * TOP, 400)
        assert not any(possible(more._replace(collective=c)) for c in tried)
    if possible(expected) and possible(expected._replace(yaw=0.0)):
        assert result == pytest.approx(expected, abs=1e-9)
    elif result.yaw != yaw and any(share[3] for share in shares):
        assert not possible(result._replace(yaw=result.yaw + 1e-3 * np.sign(yaw - result.yaw)))


def test_failed_motor_stays_allocated_in_failure_mode_ignore():
    whole, failed = ((1.0, 1.0, 1.0, 1.0),), ((0.0, 0.0, 0.0, 0.0),)
    assert tables_for_failures((whole, failed), {}) == (whole, failed)
    assert tables_for_failures((whole, failed), {"CA_FAILURE_MODE": 1.0}) == (whole, failed)
    assert tables_for_failures((whole, failed), {"CA_FAILURE_MODE": 0.0}) == (whole, whole)
