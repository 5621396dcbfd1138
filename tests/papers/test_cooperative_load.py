"""Cooperative load against an independent constrained formulation, and invariants."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lapwing.dynamics.integrators import get, rate, simulate
from lapwing.dynamics.lie.quaternion import exp, rotation_matrix
from lapwing.dynamics.lie.ts2 import Swing, normalise
from lapwing.dynamics.vector import dot, multiply
from lapwing.kernels import kernel
from lapwing.kernels.state_tree import embed, unflatten
from lapwing.papers.cooperative_load.cooperative_load import (
    CooperativeLoadParameters,
    CooperativeLoadState,
    LiftCommand,
    quad_position,
    quad_velocity,
)

ZERO = (0.0, 0.0, 0.0)
INERTIA = (0.0820, 0.0845, 0.1377)
G = 9.81


@kernel
def energy(p, x):
    """Return kinetic and potential energy [J] (theory, eq. (7.17))."""
    total = 0.5 * p.load_mass * dot(x.load_velocity, x.load_velocity) + p.load_mass * p.gravity * x.load_position[2]
    for i in range(len(x.link)):
        v, o = quad_velocity(p, x, i), x.omega_body[i]
        total += 0.5 * (p.quad_mass[i] * dot(v, v) + dot(o, multiply(p.quad_inertia[i], o)))
        total += p.quad_mass[i] * p.gravity * quad_position(p, x, i)[2]
    return total


def swinging(n, seed=0):
    """Return a spinning and swinging start in general position."""
    rng = np.random.default_rng(seed)
    v = lambda s: tuple(map(float, s * rng.standard_normal(3)))  # noqa: E731
    return CooperativeLoadState(
        v(1),
        v(1),
        tuple(exp(v(0.5)) for _ in range(n)),
        tuple(v(1) for _ in range(n)),
        tuple(normalise(Swing(tuple(np.array((0, 0, -1.0)) + v(0.4)), v(0.7))) for _ in range(n)),
    )


def system(n, control):
    return CooperativeLoadParameters((0.755, 0.9, 0.6)[:n], (INERTIA,) * n, (0.6, 0.8, 1.1)[:n], 0.4, G, control)


def pushing(n):
    return LiftCommand((6.0, 7.5, 3.0)[:n], ((0.02, -0.01, 0.03), (-0.04, 0.0, 0.01), ZERO)[:n])


def constrained_accelerations(p, x):
    """Return accelerations of particles constrained by |r_i - y| = L_i, by Lagrange multipliers, without spheres."""
    n = len(x.link)
    mass = np.repeat([p.load_mass, *p.quad_mass], 3)
    y, v = np.array(x.load_position), np.array(x.load_velocity)
    force = [np.array((0, 0, -p.load_mass * p.gravity))]
    jacobian, right = np.zeros((n, 3 * n + 3)), np.zeros(n)
    for i in range(n):
        thrust = np.array(rotation_matrix(x.attitude[i])).reshape(3, 3)[:, 2] * p.control.thrust[i]
        force.append(thrust - np.array((0, 0, p.quad_mass[i] * p.gravity)))
        d = np.array(quad_position(p, x, i)) - y
        dv = np.array(quad_velocity(p, x, i)) - v
        jacobian[i, :3], jacobian[i, 3 + 3 * i : 6 + 3 * i] = -d, d
        right[i] = -dv @ dv
    saddle = np.block([[np.diag(mass), jacobian.T], [jacobian, np.zeros((n, n))]])
    return np.linalg.solve(saddle, np.concatenate([*force, right]))[: 3 * n + 3].reshape(-1, 3)


@pytest.mark.parametrize("n", [2, 3])
def test_accelerations_equal_those_of_constrained_particles(n):
    p = system(n, pushing(n))
    for seed in range(3):
        x = swinging(n, seed)
        actual, exact = rate(p, 0.0, x), constrained_accelerations(p, x)
        assert actual.load_velocity == pytest.approx(exact[0], abs=1e-11)
        for i in range(n):
            q, omega = np.array(x.link[i].direction), np.array(x.link[i].omega)
            _, omega_rate = embed(x.link[i], actual.link[i])
            swing = np.cross(omega_rate, q) + np.cross(omega, np.cross(omega, q))
            assert actual.load_velocity - p.link_length[i] * swing == pytest.approx(exact[i + 1], abs=1e-11)
            assert abs(np.dot(q, omega_rate)) < 1e-14 * (1 + np.linalg.norm(omega_rate))


def test_whole_flight_agrees_with_constrained_formulation():
    p, x0 = system(2, pushing(2)), swinging(2, 5)
    _, states = simulate(get("rkmk4"), p, x0, 1e-3, 1000, every=1000)
    end = unflatten(x0, tuple(map(float, states[-1])))
    # separate particles and bodies, joined by multipliers; attitudes as nine numbers
    start = [x0.load_position, *(quad_position(p, x0, i) for i in range(2))]
    speed = [x0.load_velocity, *(quad_velocity(p, x0, i) for i in range(2))]
    turned = [np.array(rotation_matrix(q)).reshape(3, 3) for q in x0.attitude]
    y0 = np.concatenate([np.ravel(start), np.ravel(speed), np.ravel(turned), np.ravel(x0.omega_body)])
    mass = np.repeat([p.load_mass, *p.quad_mass], 3)

    def right_hand_side(t, y):
        r, v, m, o = y[:9].reshape(3, 3), y[9:18].reshape(3, 3), y[18:36].reshape(2, 3, 3), y[36:].reshape(2, 3)
        force, jacobian, right = np.zeros((3, 3)), np.zeros((2, 9)), np.zeros(2)
        force[:, 2] = -mass[::3] * p.gravity
        for i in range(2):
            force[i + 1] += m[i][:, 2] * p.control.thrust[i]
            d, dv = r[i + 1] - r[0], v[i + 1] - v[0]
            jacobian[i, :3], jacobian[i, 3 + 3 * i : 6 + 3 * i] = -d, d
            right[i] = -dv @ dv
        saddle = np.block([[np.diag(mass), jacobian.T], [jacobian, np.zeros((2, 2))]])
        a = np.linalg.solve(saddle, np.concatenate([force.ravel(), right]))[:9]
        turning = [m[i] @ np.cross(np.eye(3), o[i]) for i in range(2)]
        angular = [(p.control.moment_body[i] - np.cross(o[i], INERTIA * o[i])) / INERTIA for i in range(2)]
        return np.concatenate([v.ravel(), a, np.ravel(turning), np.ravel(angular)])

    other = solve_ivp(right_hand_side, (0, 1), y0, method="DOP853", rtol=1e-11, atol=1e-11).y[:, -1]
    ours = [end.load_position, *(quad_position(p, end, i) for i in range(2))]
    assert np.ravel(ours) == pytest.approx(other[:9], abs=1e-8)
    assert np.ravel([rotation_matrix(q) for q in end.attitude]) == pytest.approx(other[18:36], abs=1e-8)


def test_energy_and_constraints_without_rotors():
    p = system(2, LiftCommand((0.0, 0.0), (ZERO, ZERO)))
    x0 = swinging(2, 3)
    _, rows = simulate(get("rkmk4"), p, x0, 1e-3, 5000, every=200)
    energies = [energy(p, unflatten(x0, tuple(map(float, row)))) for row in rows]
    assert energies == pytest.approx([energies[0]] * 26, rel=1e-10)


@pytest.mark.parametrize("method", ["lie_euler", "rkmk4"])
def test_constraints_hold_to_round_off_in_each_method(method):
    p, x0 = system(2, pushing(2)), swinging(2, 3)
    _, rows = simulate(get(method), p, x0, 0.01, 500)
    for i in range(2):
        at = 6 + 8 + 6 + 6 * i
        q, omega = rows[:, at : at + 3], rows[:, at + 3 : at + 6]
        assert abs((q**2).sum(axis=1) - 1).max() < 1e-15
        assert (abs((q * omega).sum(axis=1)) / (1 + abs(omega).max(axis=1))).max() < 1e-15


def test_invalid_parameters_are_rejected():
    p, x0 = system(2, pushing(2)), swinging(2)
    cases = {
        r"link_length\[1\] = 0: must be positive": p._replace(link_length=(0.6, 0.0)),
        r"quad_mass\[0\] = -1: must be positive": p._replace(quad_mass=(-1.0, 0.9)),
        r"load_mass = 0: must be positive": p._replace(load_mass=0.0),
        r"2 links for tuples of \[2, 3\] entries": p._replace(link_length=(0.6, 0.8, 1.0)),
    }
    for message, wrong in cases.items():
        with pytest.raises(ValueError, match=rf"CooperativeLoad: {message}"):
            simulate(get("rkmk4"), wrong, x0, 0.01, 10)
