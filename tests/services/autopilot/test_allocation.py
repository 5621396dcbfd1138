"""Control allocation for any set of rotors: identities on the effectiveness matrix, and priorities under saturation."""

import numpy as np
import pytest
from closed_loop import AIRFRAME
from hypothesis import example, given, settings
from hypothesis import strategies as st

from lapwing.services.autopilot import controller_parameters
from lapwing.services.autopilot.allocation import demand_effects, effectiveness, shares_of, tables, tilted_effectiveness
from lapwing.services.autopilot.mixer import VirtualControls, mix, saturate

TOP, YAW = 10.0, 0.02  # [N], [m]
HALF = 0.5 * np.pi


def ring(angles, spins, radius=0.3):
    """Effectiveness of rotors on a circle."""
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
def test_allocation_times_effectiveness_is_the_identity(name):
    B = ROTORS[name]
    found = B @ np.array(shares_of(B))
    assert found == pytest.approx(np.diag(demand_effects(B)), abs=1e-12)


def test_of_all_thrusts_that_give_a_wrench_they_are_the_least():
    B = ROTORS["octa"]
    wanted = np.array([20.0, 0.3, -0.2, 0.05])
    assert np.array(shares_of(B)) @ (wanted / demand_effects(B)) == pytest.approx(np.linalg.pinv(B) @ wanted)


def test_four_rotors_in_a_cross_have_shares_of_one_to_the_bit():
    a = AIRFRAME
    signs = [(1.0, np.sign(y), -np.sign(x), s) for x, y, s in zip(a.rotor_x, a.rotor_y, a.reaction_sign, strict=True)]
    assert controller_parameters.shares(a) == (tuple(signs),)


@pytest.mark.parametrize("name", ["hexa X", "octa"])
def test_a_failed_rotor_gives_nothing_and_the_others_all_of_lift_roll_and_pitch(name):
    B = ROTORS[name]
    for k, shares in enumerate(tables(B)[1:]):
        assert shares[k] == (0.0, 0.0, 0.0, 0.0)
        found = B @ np.array(shares) / demand_effects(B)[:, None]
        assert found[:3] == pytest.approx(np.eye(4)[:3], abs=1e-12)


def test_which_failures_leave_yaw_to_a_hexacopter_is_as_published():
    """Du, Quan, Yang, Cai, J. Guidance, Control, and Dynamics 38 (2015) 978: turning PNPNPN it is uncontrollable
    without any one rotor; turning PPNNPN it is controllable without one of the first four."""
    yaw = [any(share[3] for share in shares) for shares in tables(HEXA_X)[1:]]
    assert yaw == [True, True, True, True, False, False]
    assert not any(any(share[3] for share in shares) for shares in tables(ROTORS["hexa +"])[1:])


@pytest.mark.parametrize("name", ["quad +", "X8, coaxial", "Y6, coaxial"])
def test_without_a_rotor_to_spare_or_to_tell_there_is_one_table(name):
    assert len(tables(ROTORS[name])) == 1


@pytest.mark.parametrize(
    "B",
    [
        ring(circle(3), [1, -1, 1]),  # three numbers cannot be four
        ring(circle(4), [1, 1, 1, 1]),  # yaw comes with lift
        effectiveness((0.3, 0.2, -0.3, 0.1), (0.0, 0.0, 0.0, 0.0), (YAW, -YAW, YAW, -YAW)),  # in a row
        effectiveness((0.3, 0.1, 0.1, 0.3), (0.2, 0.2, -0.2, -0.2), (YAW, -YAW, YAW, -YAW)),  # all in front
    ],
)
def test_rotors_that_cannot_balance_the_vehicle_are_refused(B):
    with pytest.raises(ValueError, match="cannot be balanced; expected lift from each"):
        tables(B)


ANY = st.floats(-30.0, 30.0)


@example(
    6.0, 1.0, 4.0, 1.0, ((1.0, 1.0, -1.0, 1.0), (1.0, 1.0, 1.0, -1.0), (1.0, -1.0, 1.0, 1.0), (1.0, -1.0, -1.0, -1.0))
)  # possible with yaw only
@given(ANY, ANY, ANY, ANY, st.sampled_from([tables(B)[-1] for B in ROTORS.values()]))
@settings(deadline=None, max_examples=300)
def test_roll_and_pitch_are_kept_before_lift_and_lift_before_yaw(collective, roll, pitch, yaw, shares):
    wanted = VirtualControls(collective, roll, pitch, yaw)
    found = saturate(shares, wanted, TOP)
    thrust = np.array(mix(shares, found))
    assert thrust.min() >= -1e-9
    assert thrust.max() <= TOP + 1e-9

    def possible(q):
        asked = [np.dot(share, q) for share in shares]
        return min(asked) >= -1e-9 and max(asked) <= TOP + 1e-9

    tilt = np.array([(s[1] * roll + s[2] * pitch, s[0]) for s in shares if s[0] > 0.0])
    lifts = (-tilt[:, 0] / tilt[:, 1]).max(), ((TOP - tilt[:, 0]) / tilt[:, 1]).min()
    if lifts[0] <= lifts[1]:  # some collective makes room for all of roll and pitch
        assert found[1:3] == (roll, pitch)
        assert found.collective == pytest.approx(np.clip(collective, *lifts), abs=1e-9)
    else:
        more = found._replace(roll=1.001 * found.roll, pitch=1.001 * found.pitch, yaw=0.0)
        tried = np.linspace(0.0, 4.0 * TOP, 400)
        assert not any(possible(more._replace(collective=c)) for c in tried)
    if possible(wanted) and possible(wanted._replace(yaw=0.0)):
        assert found == pytest.approx(wanted, abs=1e-9)
    elif found.yaw != yaw and any(share[3] for share in shares):
        assert not possible(found._replace(yaw=found.yaw + 1e-3 * np.sign(yaw - found.yaw)))
