"""Action of SE(3) on TS^2: group action, generator, and both constraints."""

import numpy as np
import pytest

from lapwing.dynamics.lie import se3, so3, ts2
from lapwing.dynamics.lie.ts2 import Swing
from lapwing.dynamics.vector import cross, dot

pytestmark = pytest.mark.usefixtures("uncompiled")

X = ts2.normalise(Swing((0.3, -0.5, 0.9), (1.0, 0.4, 0.2)))
MU = ((0.3, -1.1, 0.7), (0.5, 0.2, -0.9))


def test_action_is_group_action():
    g, h = ((0.2, 0.5, -1.0), (0.1, 0.9, 0.3)), ((-0.7, 0.1, 0.4), (0.6, -0.2, 1.5))
    # product of (exp(r), s) pairs: rotation R_g R_h, shift s_g + R_g s_h
    rotation = so3.log(tuple((np.array(so3.exp(g[0])).reshape(3, 3) @ np.array(so3.exp(h[0])).reshape(3, 3)).ravel()))
    shift = tuple(np.array(g[1]) + so3.turn(g[0], h[1]))
    one, two = ts2.act(rotation, shift, X), ts2.act(*g, ts2.act(*h, X))
    assert one.direction == pytest.approx(two.direction, abs=2e-15)
    assert one.omega == pytest.approx(two.omega, abs=2e-15)


def test_tangent_contains_kinematics_and_acceleration():
    acceleration = cross(X.direction, (0.4, -0.3, 2.0))
    direction, omega = ts2.embed(X, ts2.tangent(X, acceleration))
    assert direction == pytest.approx(cross(X.omega, X.direction), abs=1e-16)
    assert omega == pytest.approx(acceleration, abs=1e-15)


def test_embed_is_derivative_along_retract():
    h = 1e-6
    ahead, behind = (ts2.retract(X, tuple(tuple(s * h * c for c in part) for part in MU)) for s in (1, -1))
    for a, b, d in zip(ahead, behind, ts2.embed(X, MU), strict=True):
        assert (np.array(a) - b) / (2 * h) == pytest.approx(np.array(d), abs=1e-9)


def test_constraints_hold_to_round_off_over_many_steps():
    x = X
    for _ in range(5000):
        x = ts2.retract(x, tuple(tuple(0.05 * c for c in part) for part in MU))
        assert abs(dot(x.direction, x.direction) - 1.0) < 1e-15
        assert abs(dot(x.direction, x.omega)) < 2e-16 * max(1.0, dot(x.omega, x.omega) ** 0.5) * 2


def test_exponential_equals_that_of_se3():
    g = se3.exp((MU[1], MU[0]))
    y = ts2.retract(X, MU)
    assert y.direction == pytest.approx(so3.turn(MU[0], X.direction), abs=1e-15)
    assert y.omega == pytest.approx(np.array(so3.turn(MU[0], X.omega)) + cross(g.position, y.direction), abs=2e-15)
