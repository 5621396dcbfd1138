"""The embedding technique: equations of motion for the independent accelerations alone, without multipliers.

An independent method for the accelerations that shares only the rows with `augmented`; dense NumPy.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import qr

from lapwing.dynamics.multibody.augmented import (
    RANK_TOLERANCE,
    as_float_arrays,
    generalised_force,
    mass_roots,
    raise_if_singular,
)
from lapwing.dynamics.multibody.stabilisation import rows


class Reduced(NamedTuple):
    """Equations of the f independent coordinates of n bodies."""

    acceleration: np.ndarray  # (n, 6) of all coordinates
    independent: np.ndarray  # (f,) indices into the 6 n coordinates
    velocity_map: np.ndarray  # (6 n, f): velocity = velocity_map @ velocity[independent] + velocity imposed by drives
    mass: np.ndarray  # (f, f) reduced mass matrix


def accelerations(system, configuration, velocity, wrench=None, drive=None) -> Reduced:
    """Return accelerations by coordinate partitioning of the index-1 equations (theory, eqs. (8.25)-(8.27)).

    See `augmented.accelerations` for arguments and errors.
    """
    configuration, velocity, wrench, drive = as_float_arrays(system, configuration, velocity, wrench, drive)
    p, e = rows(system.arrays, configuration, velocity, drive)
    raise_if_singular(system, p.singular)
    J, n = e.jacobian_t.T, 6 * len(system.bodies)
    Q, R, order = qr(J, pivoting=True, mode="economic")
    size = np.abs(np.diag(R))
    rank = int(np.sum(size > RANK_TOLERANCE * max(size.max(), 1.0))) if size.size else 0
    dependent, independent = order[:rank], np.sort(order[rank:])
    upper, rest = R[:rank, :rank], Q[:, :rank].T
    velocity_map, particular = np.zeros((n, n - rank)), np.zeros(n)
    velocity_map[independent, np.arange(n - rank)] = 1.0
    velocity_map[dependent] = -np.linalg.solve(upper, rest @ J[:, independent])
    particular[dependent] = np.linalg.solve(upper, rest @ e.gamma)
    mass = mass_matrix(system, p)
    force = generalised_force(system.arrays, p, wrench).ravel()
    reduced = velocity_map.T @ mass @ velocity_map
    own = np.linalg.solve(reduced, velocity_map.T @ (force - mass @ particular))
    return Reduced((velocity_map @ own + particular).reshape(-1, 6), independent, velocity_map, reduced)


def mass_matrix(system, placement) -> np.ndarray:
    """Return the assembled mass matrix, shape (6 n, 6 n), block diagonal (theory, eq. (8.5))."""
    root, rotational = mass_roots(system.arrays, placement)
    out = np.zeros((6 * len(root), 6 * len(root)))
    for b in range(len(root)):
        L = rotational[b].reshape(3, 3)
        out[6 * b : 6 * b + 3, 6 * b : 6 * b + 3] = root[b] ** 2 * np.eye(3)
        out[6 * b + 3 : 6 * b + 6, 6 * b + 3 : 6 * b + 6] = L @ L.T
    return out
