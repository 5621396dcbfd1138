"""Free rigid body in closed form: Jacobi's elliptic functions, and a quadrature for the last angle."""

import numpy as np
from scipy.integrate import quad_vec
from scipy.special import ellipj, ellipkinc

from lapwing.dynamics.lie.quaternion import exp
from lapwing.dynamics.vehicles.rigid_body import FreeBodyParameters, RigidBody
from lapwing.studies.accuracy.coordinates import matrices
from lapwing.studies.accuracy.integrate import solver_methods
from lapwing.studies.accuracy.problem import Problem
from lapwing.studies.accuracy.reference import to_world

INERTIA = (1.0, 1.6, 2.1)  # [kg m^2]
START = RigidBody(exp((0.3, -0.5, 0.2)), (0.6, 0.4, 1.2))
DURATION = 60.0  # [s]


def problems() -> dict[str, Problem]:
    """Return the problem of this file: a tumbling body with three different moments of inertia."""
    problem = Problem(
        "free rigid body, three different moments of inertia",
        DURATION,
        solver_methods(FreeBodyParameters(INERTIA), START, DURATION, 64),
        lambda: closed_form(INERTIA, START, DURATION),
        "closed form: Jacobi elliptic functions, the last angle by quadrature",
        {"energy": energy, "momentum": momentum},
    )
    return {"free_rigid_body": problem}


def energy(t: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the kinetic energy [J], shape (k,)."""
    return 0.5 * (y[:, 9:12] ** 2 * INERTIA).sum(axis=1)


def momentum(t: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the angular momentum in the world [N m s], shape (k, 3)."""
    return to_world(y[:, :9], y[:, 9:12] * INERTIA)


def closed_form(inertia: tuple[float, float, float], start: RigidBody, t: float) -> np.ndarray:
    """Return the coordinates at time t (theory, eqs. (7.2) to (7.5) and (7.5a)).

    It holds for rotation about the axis of the largest moment, with omega_1 and omega_3 positive at the start.
    """
    A, B, C = inertia
    o = np.array(start.omega_body)
    twice_energy, square = float(np.array(inertia) @ o**2), float(np.square(inertia) @ o**2)
    a1 = np.sqrt((twice_energy * C - square) / (A * (C - A)))
    a2 = np.sqrt((twice_energy * C - square) / (B * (C - B)))
    a3 = np.sqrt((square - twice_energy * A) / (C * (C - A)))
    rate = np.sqrt((C - B) * (square - twice_energy * A) / (A * B * C))
    m = (B - A) * (twice_energy * C - square) / ((C - B) * (square - twice_energy * A))
    phase = ellipkinc(np.arctan2(o[1] / a2, o[0] / a1), m)

    def omega(time: float) -> np.ndarray:
        sn, cn, dn, _ = ellipj(rate * time + phase, m)
        return np.array([a1 * cn, a2 * sn, a3 * dn])

    def precession(time: float) -> float:
        x, y, _ = omega(time)
        return np.sqrt(square) * (A * x * x + B * y * y) / ((A * x) ** 2 + (B * y) ** 2)

    angle = quad_vec(precession, 0.0, t, epsabs=1e-14, epsrel=1e-14, limit=20_000)[0]
    R_start = matrices(np.array([start.attitude])).reshape(3, 3)
    end = omega(t)
    before, after = _upright(np.multiply(inertia, o)), _upright(np.multiply(inertia, end))
    cosine, sine = np.cos(angle), np.sin(angle)
    R = R_start @ before.T @ np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]]) @ after
    return np.concatenate([R.ravel(), end])


def _upright(momentum_body: np.ndarray) -> np.ndarray:
    """Return the rotation without a turn about z that takes a body momentum to the z axis; shape (3, 3)."""
    x, y, z = momentum_body / np.linalg.norm(momentum_body)
    across = np.hypot(x, y)
    # rows: the line of nodes, the direction normal to it, the momentum
    return np.array([[y / across, -x / across, 0.0], [x * z / across, y * z / across, -across], [x, y, z]])
