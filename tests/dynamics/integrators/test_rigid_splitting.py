"""Energy-conserving method: closed form of the free body, and invariants over a long time."""

import math

import numpy as np
import pytest
from scipy.special import ellipj, ellipkinc

from lapwing.dynamics.integrators import get, simulate, solve
from lapwing.dynamics.lie.quaternion import exp
from lapwing.dynamics.vehicles.rigid_body import FreeBodyParameters, RigidBody

INERTIA = (1.0, 1.7, 2.3)
OMEGA = (0.8, 0.5, 0.9)
P, START = FreeBodyParameters(INERTIA), RigidBody(exp((0.3, -0.2, 0.9)), OMEGA)


def closed_form(t):
    """Return omega_body(t) by Jacobi's elliptic functions (theory, eqs. (7.2) to (7.5)), for 2 T B < L^2."""
    a, b, c = INERTIA
    o1, o2, o3 = OMEGA
    energy, square = a * o1**2 + b * o2**2 + c * o3**2, (a * o1) ** 2 + (b * o2) ** 2 + (c * o3) ** 2
    assert square > energy * b
    first = math.sqrt((energy * c - square) / (a * (c - a)))
    second = math.sqrt((energy * c - square) / (b * (c - b)))
    third = math.sqrt((square - energy * a) / (c * (c - a)))
    speed = math.sqrt((c - b) * (square - energy * a) / (a * b * c))
    m = (b - a) * (energy * c - square) / ((c - b) * (square - energy * a))
    # with o1 and o3 positive, o2' = (C - A) o3 o1 / B > 0: o1 = first cn, o2 = second sn, o3 = third dn
    phase = ellipkinc(math.atan2(o2 / second, o1 / first), m)
    sn, cn, dn, _ = ellipj(speed * t + phase, m)
    return np.column_stack([first * cn, second * sn, third * dn])


def invariants(states):
    w = states[:, 0]
    momentum = states[:, 4:] * INERTIA
    u = states[:, 1:4]
    t = 2 * np.cross(u, momentum)
    world = momentum + w[:, None] * t + np.cross(u, t)
    return 0.5 * (momentum * states[:, 4:]).sum(axis=1), world


def test_closed_form_is_solution():
    # guards the test itself: Euler's equations by differences of the closed form
    t, h = np.linspace(0, 30, 61), 1e-5
    derivative = (closed_form(t + h) - closed_form(t - h)) / (2 * h)
    o = closed_form(t)
    assert closed_form(np.zeros(1))[0] == pytest.approx(OMEGA, abs=1e-14)
    assert derivative == pytest.approx(np.cross(o * INERTIA, o) / INERTIA, abs=1e-9)


@pytest.mark.parametrize(("name", "allowed"), [("rigid_splitting", 1e-11), ("rkmk4", 1e-6), ("rk4_renormalised", 1e-6)])
def test_free_body_against_elliptic_functions(name, allowed):
    times, states = simulate(get(name), P, START, 0.02, 1500, every=10)
    assert abs(states[:, 4:] - closed_form(times)).max() < allowed


def test_adaptive_run_against_elliptic_functions():
    times = np.linspace(0.0, 30.0, 200)
    assert abs(solve(P, START, times, 1e-12)[0][:, 4:] - closed_form(times)).max() < 1e-10


def test_momentum_is_exact_and_energy_has_no_drift():
    _, states = simulate(get("rigid_splitting"), P, START, 0.1, 200_000, every=200)
    energy, world = invariants(states)
    assert abs(world - world[0]).max() < 1e-11  # 2 million turns of 45 roundings each
    early, late = (abs(part / energy[0] - 1).max() for part in (energy[:100], energy[-100:]))
    assert early < 1e-9
    assert late < 2 * early + 1e-12


def test_method_without_splitting_drifts():
    _, states = simulate(get("rkmk4"), P, START, 0.1, 200_000, every=200)
    energy, _ = invariants(states)
    assert abs(energy[-1] / energy[0] - 1) > 1e-6
