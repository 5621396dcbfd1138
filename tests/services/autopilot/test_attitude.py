import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lapwing.dynamics.lie.quaternion import from_roll_pitch_yaw, retract, to_roll_pitch_yaw
from lapwing.dynamics.vector import scale, subtract
from lapwing.services.autopilot.control import angle_rates, body_rates, error_by_angle, error_on_so3, wrap

TILT = st.floats(-1.2, 1.2)
RATES = st.tuples(*[st.floats(-3.0, 3.0)] * 3)
ZERO = (0.0, 0.0, 0.0)


@given(TILT, TILT, RATES)
@settings(deadline=None)
def test_rates_of_angles_are_their_difference_quotients(roll, pitch, omega):
    q, h = from_roll_pitch_yaw(roll, pitch, 0.3), 1e-5
    after, before = (to_roll_pitch_yaw(retract(q, scale(s * h, omega))) for s in (1.0, -1.0))
    assert angle_rates(roll, pitch, omega) == pytest.approx(scale(0.5 / h, subtract(after, before)), abs=1e-5)
    assert body_rates(roll, pitch, angle_rates(roll, pitch, omega)) == pytest.approx(omega, abs=1e-12)


@given(TILT, TILT, st.floats(-3.0, 3.0), RATES)
@settings(deadline=None)
def test_so3_error_rotates_attitude_onto_reference(roll, pitch, yaw, turn):
    reference = (0.2, -0.3, 1.0)
    attitude = from_roll_pitch_yaw(roll, pitch, yaw)
    error, _ = error_on_so3(attitude, reference, ZERO, ZERO)
    assert to_roll_pitch_yaw(retract(attitude, error)) == pytest.approx(reference, abs=1e-9)


def test_attitude_errors_agree_for_small_angles():
    angles, reference, rates, omega = (0.01, -0.02, 1.0), (0.02, 0.01, 1.01), (0.3, -0.2, 0.1), (0.5, 0.4, -0.3)
    a, da = error_by_angle(angles, reference, rates, omega)
    q = from_roll_pitch_yaw(*angles)
    b, db = error_on_so3(q, reference, rates, omega)
    assert b == pytest.approx(a, abs=1e-3)
    assert db == pytest.approx(da, abs=0.02)
    h = 1e-6
    q_later = retract(q, scale(h, omega))
    later = tuple(np.add(reference, scale(h, rates)))
    a_later, _ = error_by_angle(to_roll_pitch_yaw(q_later), later, rates, omega)
    b_later, _ = error_on_so3(q_later, later, rates, omega)
    assert da == pytest.approx(scale(1.0 / h, subtract(a_later, a)), abs=1e-5)
    assert db == pytest.approx(scale(1.0 / h, subtract(b_later, b)), abs=0.02)  # to first order in the error


@pytest.mark.parametrize(
    ("angle", "wrapped"), [(3.5, 3.5 - 2 * math.pi), (-3.5, 2 * math.pi - 3.5), (1.0, 1.0), (7.0, 7.0 - 2 * math.pi)]
)
def test_wrapped_yaw_is_shortest_turn(angle, wrapped):
    assert wrap(angle) == pytest.approx(wrapped)
