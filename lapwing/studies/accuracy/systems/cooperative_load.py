"""Two quadrotors with a shared load: swinging under steady thrusts, and falling with the rotors off."""

import numpy as np

from lapwing.dynamics.lie.quaternion import exp
from lapwing.dynamics.lie.ts2 import Swing, normalise
from lapwing.papers.cooperative_load.cooperative_load import (
    CooperativeLoadParameters,
    CooperativeLoadState,
    LiftCommand,
)
from lapwing.studies.accuracy.coordinates import of_state
from lapwing.studies.accuracy.integrate import solver_methods
from lapwing.studies.accuracy.problem import Problem
from lapwing.studies.accuracy.reference import TOLERANCE, attitude_rate, dop853

DURATION = 2.0  # [s]
INERTIA = (0.0820, 0.0845, 0.1377)  # [kg m^2]
START = CooperativeLoadState(
    (-2.0, 0.0, 1.0),
    (0.5, -0.3, 0.2),
    (exp((0.2, -0.1, 0.3)), exp((-0.1, 0.2, 0.1))),
    ((0.5, -0.4, 0.3), (-0.3, 0.6, 0.2)),
    (normalise(Swing((0.6, 0.1, -0.8), (0.4, 1.0, -0.3))), normalise(Swing((-0.5, -0.2, -0.8), (0.2, -0.7, 0.5)))),
)
PUSHED = LiftCommand((9.0, 10.0), ((0.02, -0.01, 0.03), (-0.02, 0.015, 0.01)))
OFF = LiftCommand((0.0, 0.0), ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))


def _parameters(control: LiftCommand) -> CooperativeLoadParameters:
    return CooperativeLoadParameters((0.755, 0.755), (INERTIA, INERTIA), (0.6, 0.8), 0.4, 9.81, control)


def problems() -> dict[str, Problem]:
    """Return this file's problems: a shared load under steady thrusts and moments, and falling with rotors off."""
    return {
        "cooperative_load": _problem("steady thrusts and moments", _parameters(PUSHED), {}),
        "cooperative_load_falling": _problem("rotors off", _parameters(OFF), {"energy": energy}),
    }


def _problem(title: str, p: CooperativeLoadParameters, invariants: dict) -> Problem:
    return Problem(
        f"two quadrotors with a load: {title}",
        DURATION,
        solver_methods(p, START, DURATION, 16),
        lambda: free_motion(p, START, DURATION),
        f"SciPy DOP853 at {TOLERANCE:g} on three particles held together by Lagrange multipliers",
        invariants,
    )


def free_motion(p: CooperativeLoadParameters, x: CooperativeLoadState, duration: float) -> np.ndarray:
    """Return the final coordinates of free particles under constraint forces, without coordinates on spheres."""
    y, n = of_state(x), len(x.link)
    length = np.array(p.link_length)[:, None]
    # coordinates of the state: load 0:6, attitudes, angular velocities, then q and omega of each link
    at = 6 + 12 * n
    q, omega = y[at:].reshape(n, 6)[:, :3], y[at:].reshape(n, 6)[:, 3:]
    places = np.vstack([y[:3], y[:3] - length * q])
    speeds = np.vstack([y[3:6], y[3:6] - length * np.cross(omega, q)])
    start = np.concatenate([places.ravel(), speeds.ravel(), y[6:at]])
    end = dop853(lambda t, z: right_hand_side(p, z), start, duration)
    r, v = end[: 3 * n + 3].reshape(-1, 3), end[3 * n + 3 : 6 * n + 6].reshape(-1, 3)
    q = (r[0] - r[1:]) / length
    omega = np.cross(q, (v[0] - v[1:]) / length)
    return np.concatenate([r[0], v[0], end[6 * n + 6 :], np.hstack([q, omega]).ravel()])


def right_hand_side(p: CooperativeLoadParameters, z: np.ndarray) -> np.ndarray:
    """Return Newton's equations of load and quadrotors with |r_i - r_0| = L_i by multipliers, and attitudes."""
    n = len(p.link_length)
    k = 3 * n + 3
    r, v = z[:k].reshape(-1, 3), z[k : 2 * k].reshape(-1, 3)
    R, o = z[2 * k : 2 * k + 9 * n].reshape(n, 9), z[2 * k + 9 * n :].reshape(n, 3)
    mass = np.repeat([p.load_mass, *p.quad_mass], 3)
    force = np.zeros((n + 1, 3))
    force[:, 2] = -mass[::3] * p.gravity
    force[1:] += R.reshape(n, 3, 3)[:, :, 2] * np.array(p.control.thrust)[:, None]
    jacobian, right = np.zeros((n, k)), np.zeros(n)
    for i in range(n):
        d, dv = r[i + 1] - r[0], v[i + 1] - v[0]
        jacobian[i, :3], jacobian[i, 3 * i + 3 : 3 * i + 6] = -d, d
        right[i] = -dv @ dv
    saddle = np.block([[np.diag(mass), jacobian.T], [jacobian, np.zeros((n, n))]])
    acceleration = np.linalg.solve(saddle, np.concatenate([force.ravel(), right]))[:k]
    inertia = np.array(p.quad_inertia)
    spin = (np.array(p.control.moment_body) - np.cross(o, inertia * o)) / inertia
    return np.concatenate([v.ravel(), acceleration, *map(attitude_rate, R, o), spin.ravel()])


def energy(t: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the kinetic and potential energy [J], shape (k,), from positions and velocities of the three masses."""
    p = _parameters(OFF)
    at, n = 30, 2
    total = p.load_mass * (0.5 * (y[:, 3:6] ** 2).sum(axis=1) + p.gravity * y[:, 2])
    for i in range(n):
        q, omega = y[:, at + 6 * i : at + 6 * i + 3], y[:, at + 6 * i + 3 : at + 6 * i + 6]
        v = y[:, 3:6] - p.link_length[i] * np.cross(omega, q)
        o = y[:, 24 + 3 * i : 27 + 3 * i]
        height = y[:, 2] - p.link_length[i] * q[:, 2]
        total += p.quad_mass[i] * (0.5 * (v**2).sum(axis=1) + p.gravity * height)
        total += 0.5 * (o**2 * p.quad_inertia[i]).sum(axis=1)
    return total
