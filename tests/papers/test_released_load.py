"""Released load: states are continuous, the load falls freely, a quadrotor follows its thrust and keeps its spin."""

import numpy as np
import pytest

from lapwing.dynamics.integrators import get, rate, simulate
from lapwing.dynamics.lie.quaternion import NO_ROTATION, exp
from lapwing.dynamics.lie.ts2 import Swing
from lapwing.kernels.state_tree import unflatten
from lapwing.papers.cooperative_load.cooperative_load import (
    CooperativeLoadParameters,
    CooperativeLoadState,
    LiftCommand,
)
from lapwing.papers.cooperative_load.released_load import release

MASS, G, THRUST = 0.7, 9.81, 9.0
INERTIA, MOMENT, SPIN = (0.08, 0.09, 0.13), (0.0, 0.0, 0.02), (0.0, 0.0, 0.3)


def let_go():
    """Return a release with both quadrotors in rotation about their axes, the second tilted by 90 degrees about x."""
    control = LiftCommand((THRUST, THRUST), (MOMENT, MOMENT))
    p = CooperativeLoadParameters((MASS, MASS), (INERTIA, INERTIA), (0.6, 0.8), 0.4, G, control)
    links = (Swing((0.0, 0.0, -1.0), (2.0, 0.0, 0.0)), Swing((1.0, 0.0, 0.0), (0.0, 0.0, 3.0)))
    tilted = exp((np.pi / 2, 0.0, 0.0))
    return release(p, CooperativeLoadState((1.0, 2.0, 3.0), (0.1, 0.2, 0.3), (NO_ROTATION, tilted), (SPIN,) * 2, links))


def test_release_keeps_state_of_every_body():
    _, x = let_go()
    assert x.quad_position == (pytest.approx((1.0, 2.0, 3.6)), pytest.approx((0.2, 2.0, 3.0)))
    # less the link's length times omega x q: (2, 0, 0) x (0, 0, -1) = (0, 2, 0) and (0, 0, 3) x (1, 0, 0) = (0, 3, 0)
    assert x.quad_velocity == (pytest.approx((0.1, -1.0, 0.3)), pytest.approx((0.1, -2.2, 0.3)))


def test_free_fall_thrust_and_spin():
    p, x = let_go()
    assert rate(p, 0.0, x).load_velocity == pytest.approx((0.0, 0.0, -G))
    _, rows = simulate(get("rk4_renormalised"), p, x, 1e-3, 1000, every=1000)
    end = unflatten(x, tuple(map(float, rows[-1])))
    fallen = np.array(x.load_position) + x.load_velocity - np.array((0.0, 0.0, G / 2))
    assert end.load_position == pytest.approx(fallen, abs=1e-11)
    for i, axis in enumerate([(0.0, 0.0, 1.0), (0.0, -1.0, 0.0)]):
        pushed = THRUST / MASS * np.array(axis) - (0.0, 0.0, G)
        exact = np.array(x.quad_position[i]) + x.quad_velocity[i] + pushed / 2
        assert end.quad_position[i] == pytest.approx(exact, abs=1e-11)
        assert end.omega_body[i] == pytest.approx((0.0, 0.0, 0.3 + 0.02 / 0.13), abs=1e-12)
