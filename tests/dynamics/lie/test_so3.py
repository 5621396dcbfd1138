"""SO(3) closed forms against 50-digit matrix functions, over the whole range of angles."""

import math

import mpmath
import numpy as np
import pytest

from lapwing.dynamics.lie import quaternion, so3
from lapwing.dynamics.lie.so3 import Rotation

pytestmark = pytest.mark.usefixtures("uncompiled")

mpmath.mp.dps = 50

ANGLES = [1e-12, 1e-9, 1e-6, 1e-3, 0.2499, 0.2501, 0.9, 0.9999, 1.0001, 2.0, math.pi - 1e-9, math.pi, math.pi + 1e-7]
ANGLES += [5.0, 6.0, 2 * math.pi - 1e-2, 2 * math.pi - 1e-4, 2 * math.pi - 1e-6]
DIRECTIONS = [(0.6, -0.48, 0.64), (0.0, 0.0, 1.0), (-0.28, 0.0, 0.96), (1 / 3, 2 / 3, -2 / 3)]
W = (0.3, -1.1, 0.7)


def cases():
    return [tuple(a * c for c in d) for a in ANGLES for d in DIRECTIONS]


def hat(v):
    x, y, z = (mpmath.mpf(c) for c in v)
    return mpmath.matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def in_hat(v, f0, f1, f2):
    """Return f0 I + f1 hat + f2 hat^2 with scalar functions of the angle, 50 digits."""
    a = mpmath.sqrt(mpmath.fsum(mpmath.mpf(c) ** 2 for c in v))
    h = hat(v)
    return f0(a) * mpmath.eye(3) + f1(a) * h + f2(a) * h * h


def exp_reference(v):
    return in_hat(v, lambda a: 1, lambda a: mpmath.sin(a) / a, lambda a: (1 - mpmath.cos(a)) / a**2)


def dexp_reference(v):
    return in_hat(v, lambda a: 1, lambda a: (1 - mpmath.cos(a)) / a**2, lambda a: (a - mpmath.sin(a)) / a**3)


def worst(actual, exact):
    return max(abs(g - e) for g, e in zip(actual, exact, strict=True))


def test_reference_exponential_is_matrix_exponential():
    for v in cases()[::7]:
        assert mpmath.mnorm(exp_reference(v) - mpmath.expm(hat(v)), 1) < 1e-30


@pytest.mark.parametrize("v", cases())
def test_exp_log_dexp_dexpinv(v):
    exact = exp_reference(v)
    assert worst(so3.exp(v), list(exact)) < 1e-15
    assert worst(so3.turn(v, W), list(exact * mpmath.matrix(W))) < 2e-15
    d = dexp_reference(v)
    assert worst(so3.dexp(v, W), list(d * mpmath.matrix(W))) < 2e-15
    inverse = mpmath.inverse(d)
    size = mpmath.mnorm(inverse, mpmath.inf)
    assert worst(so3.dexpinv(v, W), list(inverse * mpmath.matrix(W))) < 1e-14 * size


@pytest.mark.parametrize("v", cases())
def test_log_undoes_exp_to_full_relative_accuracy(v):
    a = math.sqrt(sum(c * c for c in v))
    turns = 2 * mpmath.pi if a > math.pi * (1 + 1e-15) else 0
    length = mpmath.sqrt(mpmath.fsum(mpmath.mpf(c) ** 2 for c in v))
    exact = [c * (length - turns) / length for c in v]
    actual = so3.log(so3.exp(v))
    if abs(a - math.pi) < 1e-15:  # both signs of the half turn are right
        actual = [math.copysign(1.0, g * float(e)) * g for g, e in zip(actual, exact, strict=True)]
    # beyond pi the matrix is rounded near the identity, which limits the accuracy
    allowed = 1e-14 * (abs(length - turns) if not turns else 1)
    assert worst(actual, exact) < allowed


def test_dexp_is_derivative_of_exp():
    u, du, h = np.array([0.9, -1.3, 0.4]), np.array(W), 1e-6
    difference = (np.array(so3.exp(u + h * du)) - np.array(so3.exp(u - h * du))).reshape(3, 3) / (2 * h)
    spatial = np.array(so3.hat(so3.dexp(tuple(u), W))).reshape(3, 3) @ np.array(so3.exp(u)).reshape(3, 3)
    assert difference == pytest.approx(spatial, abs=1e-8)


def test_hat_and_vee():
    assert so3.vee(so3.hat(W)) == W
    r = np.array(so3.exp((0.2, 0.5, -1.0))).reshape(3, 3)
    hatted = r @ np.array(so3.hat(W)).reshape(3, 3) @ r.T
    assert tuple(r @ W) == pytest.approx(so3.vee(tuple(hatted.ravel())), abs=1e-15)


def test_matrix_and_quaternion_leaves_agree():
    u, v = (0.3, -0.2, 0.9), (1.0, 0.4, -0.8)
    a, m = quaternion.exp(u), so3.exp(u)
    assert quaternion.rotation_matrix(quaternion.retract(a, v)) == pytest.approx(so3.retract(m, v), abs=1e-15)
    h = 1e-6
    step = lambda k: np.array(so3.retract(m, tuple(k * c for c in v)))  # noqa: E731
    assert (step(h) - step(-h)) / (2 * h) == pytest.approx(np.array(so3.embed(m, v)), abs=1e-9)


def test_transport_is_seed_formula_with_matrix_root():
    m, u, v = so3.exp((0.5, 0.1, -0.7)), (0.4, -0.9, 0.3), (1.0, 2.0, -0.5)
    r, root = np.array(m).reshape(3, 3), np.array(so3.exp(tuple(0.5 * c for c in u))).reshape(3, 3)
    there = r @ root @ root
    tangent = r @ np.array(so3.hat(v)).reshape(3, 3)
    moved = there.T @ (r @ root @ r.T @ tangent @ root)  # body coordinates at the far end
    assert quaternion.transport(u, so3.vee(tuple(moved.ravel()))) == pytest.approx(v, abs=1e-15)


def test_normalise_finds_polar_factor():
    rng = np.random.default_rng(4)
    m = np.array(so3.exp((0.7, -2.0, 0.3))).reshape(3, 3) + 0.02 * rng.standard_normal((3, 3))
    left, _, right = np.linalg.svd(m)
    assert np.array(so3.normalise(tuple(m.ravel()))).reshape(3, 3) == pytest.approx(left @ right, abs=1e-14)


def test_retract_stays_rotation_over_many_equal_steps():
    m = Rotation(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    for _ in range(5000):
        m = so3.retract(m, (0.0123, -0.021, 0.0087))
    r = np.array(m).reshape(3, 3)
    assert abs(r.T @ r - np.eye(3)).max() < 1e-15
