"""SE(3) against 50-digit functions of the 6x6 adjoint matrix."""

import math

import mpmath
import numpy as np
import pytest

from lapwing.dynamics import vector
from lapwing.dynamics.lie import quaternion, se3

pytestmark = pytest.mark.usefixtures("uncompiled")

mpmath.mp.dps = 60

V = ((0.5, -0.2, 0.9), (0.3, -1.1, 0.7))
B = (1.2, -0.4, 0.8)
ANGLES = [1e-12, 1e-6, 0.2499, 0.9999, 1.0001, 2.0, math.pi, 5.0, 2 * math.pi - 1e-3, 2 * math.pi - 1e-6]


def elements():
    return [(B, tuple(a * c for c in d)) for a in ANGLES for d in ((0.6, -0.48, 0.64), (0.0, 0.0, 1.0))]


def hat(v):
    x, y, z = (mpmath.mpf(c) for c in v)
    return mpmath.matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def ad(u):
    m = mpmath.zeros(6)
    m[0:3, 0:3] = m[3:6, 3:6] = hat(u[1])
    m[0:3, 3:6] = hat(u[0])
    return m


def column(v):
    return mpmath.matrix([*v[0], *v[1]])


def worst(actual, exact):
    return max(abs(g - e) for g, e in zip([*actual[0], *actual[1]], exact, strict=True))


@pytest.mark.parametrize("u", elements())
def test_exp(u):
    m = mpmath.zeros(4)
    m[0:3, 0:3] = hat(u[1])
    for i in range(3):
        m[i, 3] = u[0][i]
    g = se3.exp(u)
    exact = mpmath.expm(m)
    assert max(abs(g.position[i] - exact[i, 3]) for i in range(3)) < 3e-15


def product(g, h):
    return se3.Pose(vector.add(g[0], quaternion.rotate(g[1], h[0])), quaternion.multiply(g[1], h[1]))


def test_adjoint_moves_exponential_across():
    g, u = se3.exp(((0.3, 0.1, -2.0), (0.2, 0.5, -1.0))), (B, (0.1, -0.7, 0.4))
    left, right = product(g, se3.exp(u)), product(se3.exp(se3.adjoint(g, u)), g)
    assert left.position == pytest.approx(right.position, abs=2e-15)
    assert left.attitude == pytest.approx(right.attitude, abs=2e-15)
    assert se3.retract(g, u).position == pytest.approx(left.position, abs=2e-15)


def test_embed_is_derivative_along_retract():
    g, h = se3.exp(((0.3, 0.1, -2.0), (0.2, 0.5, -1.0))), 1e-6
    ahead, behind = (se3.retract(g, tuple(tuple(s * h * c for c in part) for part in V)) for s in (1, -1))
    position, attitude = se3.embed(g, V)
    assert (np.array(ahead.position) - behind.position) / (2 * h) == pytest.approx(np.array(position), abs=1e-9)
    assert (np.array(ahead.attitude) - behind.attitude) / (2 * h) == pytest.approx(np.array(attitude), abs=1e-9)


def test_commutator_is_ad():
    u, v = (B, (0.1, -0.7, 0.4)), V
    assert worst(se3.commutator(u, v), list(ad(u) * column(v))) < 1e-15
