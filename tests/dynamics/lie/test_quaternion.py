"""Attitudes: known rotations, conventions, and 50-digit references."""

import math

import mpmath
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from lapwing.dynamics.lie import quaternion as q
from lapwing.dynamics.vector import apply

pytestmark = pytest.mark.usefixtures("uncompiled")

angle = st.floats(-3.1, 3.1)
vector = st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3))
mpmath.mp.dps = 50
settings.register_profile("compiled", deadline=None, max_examples=50)  # the first example compiles
settings.load_profile("compiled")


def matrix(a):
    return np.array(q.rotation_matrix(a)).reshape(3, 3)


def test_quarter_turn_to_left_takes_forward_to_left():
    left = q.exp((0.0, 0.0, math.pi / 2))
    assert q.rotate(left, (1.0, 0.0, 0.0)) == pytest.approx((0.0, 1.0, 0.0), abs=1e-15)
    assert q.rotate_back(left, (0.0, 1.0, 0.0)) == pytest.approx((1.0, 0.0, 0.0), abs=1e-15)


def test_positive_pitch_points_nose_down():
    down = q.from_roll_pitch_yaw(0.0, 0.3, 0.0)
    assert q.rotate(down, (1.0, 0.0, 0.0)) == pytest.approx((math.cos(0.3), 0.0, -math.sin(0.3)), abs=1e-15)


def test_roll_pitch_yaw_is_yaw_then_pitch_then_roll():
    rx, ry, rz = (matrix(q.exp(v)) for v in ((0.4, 0.0, 0.0), (0.0, -0.7, 0.0), (0.0, 0.0, 2.5)))
    assert matrix(q.from_roll_pitch_yaw(0.4, -0.7, 2.5)) == pytest.approx(rz @ ry @ rx, abs=1e-15)


@given(angle, st.floats(-1.57, 1.57), angle)
def test_roll_pitch_yaw_round_trip(roll, pitch, yaw):
    again = q.from_roll_pitch_yaw(*q.to_roll_pitch_yaw(q.from_roll_pitch_yaw(roll, pitch, yaw)))
    # roll and yaw are ill-defined by 1 / cos(pitch) towards the vertical
    allowed = 3e-15 / math.cos(pitch)
    assert matrix(again) == pytest.approx(matrix(q.from_roll_pitch_yaw(roll, pitch, yaw)), abs=allowed)


@example((0.0, 1.293673858931998, 2.8984926736408045), (0.0, 1.293673858931998, 2.8984926736408045))
@given(vector, vector)
def test_product_rotate_and_matrix_agree(u, v):
    a, b = q.exp(u), q.exp(v)
    # ten roundings on each side; the largest measured error is 2.2e-15
    assert matrix(q.multiply(a, b)) == pytest.approx(matrix(a) @ matrix(b), abs=4e-15)
    assert q.rotate(a, v) == pytest.approx(apply(q.rotation_matrix(a), v), abs=2e-14)
    assert q.rotate_back(a, q.rotate(a, v)) == pytest.approx(v, abs=2e-14)


@pytest.mark.parametrize(
    "size", [0.0, 1e-12, 1e-9, 1e-5, 0.0499, 0.0501, 1.0, math.pi - 1e-9, math.pi, 2 * math.pi - 1e-6]
)
def test_exp_and_log_to_fifty_digits(size):
    for direction in ((0.6, -0.48, 0.64), (0.0, 0.0, 1.0), (-0.8, 0.6, 0.0)):
        v = tuple(size * d for d in direction)
        a = mpmath.sqrt(mpmath.fsum(mpmath.mpf(c) ** 2 for c in v))
        ratio = mpmath.sin(a / 2) / a if a else mpmath.mpf(1) / 2
        exact = [mpmath.cos(a / 2), *(ratio * c for c in v)]
        actual = q.exp(v)
        for g, e in zip(actual, exact, strict=True):
            assert abs(g - e) <= 2e-16 + 4e-16 * min(size, 1)
        if size < 1e-3:  # relative, where angles are small
            assert list(actual[1:]) == pytest.approx([float(e) for e in exact[1:]], rel=1e-15)
        # log of the rounded quaternion, exactly
        sine = mpmath.sqrt(mpmath.fsum(mpmath.mpf(c) ** 2 for c in actual[1:]))
        k = 2 * mpmath.atan2(sine, abs(mpmath.mpf(actual.w))) / sine * (1 if actual.w >= 0 else -1) if sine else 2
        for g, c in zip(q.log(actual), actual[1:], strict=True):
            assert abs(g - k * c) <= 1e-15 * max(abs(k * c), 1e-300) * 4


@given(vector)
def test_from_matrix_inverts_rotation_matrix(v):
    a = q.exp(v)
    b = q.from_matrix(q.rotation_matrix(a))
    assert b.w >= 0
    sign = math.copysign(1.0, sum(s * t for s, t in zip(a, b, strict=True)))
    assert [sign * c for c in b] == pytest.approx(list(a), abs=1e-15)


def test_from_matrix_keeps_tiny_angles_to_full_relative_accuracy():
    v = (1e-9, -2e-9, 3e-9)
    assert q.log(q.from_matrix(q.rotation_matrix(q.exp(v)))) == pytest.approx(v, rel=1e-15)


def test_embed_is_derivative_along_retract():
    a, w = q.exp((0.3, -1.0, 0.5)), (0.2, 0.7, -0.4)
    h = 1e-6
    ahead, behind = q.retract(a, tuple(h * c for c in w)), q.retract(a, tuple(-h * c for c in w))
    assert [(s - t) / (2 * h) for s, t in zip(ahead, behind, strict=True)] == pytest.approx(
        list(q.embed(a, w)), abs=1e-9
    )


@given(vector, st.floats(-2, 2))
def test_normalise_returns_unit_length(v, exponent):
    for scale in (10.0**exponent, 1 + 1e-9, 1 - 1e-12):
        n = q.normalise(tuple(scale * c for c in q.exp(v)))
        assert sum(c * c for c in n) == pytest.approx(1.0, abs=1e-15)


def test_retract_stays_unit_over_many_equal_steps():
    a = q.NO_ROTATION
    for _ in range(20000):
        a = q.retract(a, (0.0123, -0.021, 0.0087))
    assert abs(sum(c * c for c in a) - 1.0) < 5e-16
