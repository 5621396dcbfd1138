"""The augmented formulation: index-1 equations of motion solved for accelerations and multipliers together.

M a = Q - J^T lambda, J a = gamma (theory, eq. (8.20)). With M = L L^T the accelerations are the shortest correction
of the free motion, computed by one pivoted QR of L^-1 J^T: redundant rows are dropped, accelerations stay unique, and
the multipliers of minimum norm are returned.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lapwing.dynamics.multibody import cardan_angles, pivoted_qr
from lapwing.dynamics.multibody.body_kinematics import nine, place, three
from lapwing.dynamics.multibody.constraints import equations, in_coordinates
from lapwing.dynamics.multibody.system import System
from lapwing.dynamics.vector import apply_transposed
from lapwing.kernels import kernel, noinline

RANK_TOLERANCE = 1e-9  # relative to a unit row: a dependent row leaves only round-off after elimination
ANY = 1 << 30  # no bound on the rank


class Solution(NamedTuple):
    """Accelerations of the coordinates, and the constraint multipliers."""

    acceleration: np.ndarray  # (n, 6)
    multipliers: np.ndarray  # (m,) minimum norm, the paper's sign: constraint force = -J^T lambda
    rank: int  # number of independent rows of m
    conflict: float  # inconsistency of dependent rows [m/s^2, rad/s^2, scaled]; zero on a consistent state


@kernel
def mass_roots(a, p):
    """Return lower roots of the mass matrix's blocks: sqrt(m), shape (n,), and Cholesky of G^T I G, shape (n, 9)."""
    n = len(a.mass)
    root, rotational = np.sqrt(a.mass), np.zeros((n, 9))
    for b in range(n):
        inertia = (
            a.inertia[b, 0, 0], a.inertia[b, 0, 1], a.inertia[b, 0, 2],
            a.inertia[b, 1, 0], a.inertia[b, 1, 1], a.inertia[b, 1, 2],
            a.inertia[b, 2, 0], a.inertia[b, 2, 1], a.inertia[b, 2, 2],
        )  # fmt: skip
        I = cardan_angles.rotational_mass(nine(p.rate_matrix, b), inertia)  # noqa: E741
        l00 = np.sqrt(I[0])
        l10, l20 = I[3] / l00, I[6] / l00
        l11 = np.sqrt(I[4] - l10 * l10)
        l21 = (I[7] - l20 * l10) / l11
        l22 = np.sqrt(I[8] - l20 * l20 - l21 * l21)
        rotational[b, 0], rotational[b, 3], rotational[b, 4] = l00, l10, l11
        rotational[b, 6], rotational[b, 7], rotational[b, 8] = l20, l21, l22
    return root, rotational


@kernel
def divide_root(root, rotational, x):
    """Compute L^-1 x in place, for x of shape (6 n, c)."""
    for b in range(len(root)):
        l00, l10, l11 = rotational[b, 0], rotational[b, 3], rotational[b, 4]
        l20, l21, l22 = rotational[b, 6], rotational[b, 7], rotational[b, 8]
        k = 6 * b
        inverse, i00, i11, i22 = 1.0 / root[b], 1.0 / l00, 1.0 / l11, 1.0 / l22
        for c in range(x.shape[1]):
            x[k, c] *= inverse
            x[k + 1, c] *= inverse
            x[k + 2, c] *= inverse
            x[k + 3, c] *= i00
            x[k + 4, c] = (x[k + 4, c] - l10 * x[k + 3, c]) * i11
            x[k + 5, c] = (x[k + 5, c] - l20 * x[k + 3, c] - l21 * x[k + 4, c]) * i22


@kernel
def divide_root_transposed(root, rotational, x):
    """Compute L^-T x in place, for x of shape (6 n,)."""
    for b in range(len(root)):
        l00, l10, l11 = rotational[b, 0], rotational[b, 3], rotational[b, 4]
        l20, l21, l22 = rotational[b, 6], rotational[b, 7], rotational[b, 8]
        k = 6 * b
        for c in range(3):
            x[k + c] /= root[b]
        x[k + 5] /= l22
        x[k + 4] = (x[k + 4] - l21 * x[k + 5]) / l11
        x[k + 3] = (x[k + 3] - l10 * x[k + 4] - l20 * x[k + 5]) / l00


@noinline
def generalised_force(a, p, wrench):
    """Return Q = Q_v + Q_e, shape (n, 6), of wrenches (n, 6): force [N], world; torque [N m], body.

    See theory, eqs. (8.6), (8.18).
    """
    out = np.empty((len(a.mass), 6))
    for b in range(len(a.mass)):
        G, omega, bias = nine(p.rate_matrix, b), three(p.omega, b), three(p.bias, b)
        inertia = (
            a.inertia[b, 0, 0], a.inertia[b, 0, 1], a.inertia[b, 0, 2],
            a.inertia[b, 1, 0], a.inertia[b, 1, 1], a.inertia[b, 1, 2],
            a.inertia[b, 2, 0], a.inertia[b, 2, 1], a.inertia[b, 2, 2],
        )  # fmt: skip
        inertial = cardan_angles.quadratic_velocity(G, inertia, omega, bias)
        external = apply_transposed(G, (wrench[b, 3], wrench[b, 4], wrench[b, 5]))
        for c in range(3):
            out[b, c] = wrench[b, c] + a.mass[b] * a.gravity[c]
            out[b, 3 + c] = inertial[c] + external[c]
    return out


@kernel
def factor_rows(a, p, e, count, tolerance, most):
    """Return (root, rotational, factor) of the first `count` constraint rows."""
    root, rotational = mass_roots(a, p)
    b = e.jacobian_t[:, :count].copy()
    divide_root(root, rotational, b)
    return root, rotational, pivoted_qr.factor(b, tolerance, most)


@noinline
def constrained_acceleration(a, p, e, force, gamma, tolerance, most):
    """Return accelerations (n, 6) with M a = force - J^T lambda, J a = gamma: the core of every solve."""
    root, rotational, f = factor_rows(a, p, e, len(gamma), tolerance, most)
    free = force.copy().reshape(-1, 1)
    divide_root(root, rotational, free)
    y0 = free[:, 0]
    # residual of each row under the free motion L^-T y0
    a0 = y0.copy()
    divide_root_transposed(root, rotational, a0)
    rest = gamma.copy()
    for c in range(len(a0)):
        for r in range(len(rest)):
            rest[r] -= e.jacobian_t[c, r] * a0[c]
    y, z, conflict = pivoted_qr.shortest(f, rest)
    multipliers = -pivoted_qr.minimum_norm(f, z)
    divide_root_transposed(root, rotational, y)
    return Solution((a0 + y).reshape(-1, 6), multipliers, f.rank, conflict)


@noinline
def solve(a, configuration, velocity, wrench, drive, damping, stiffness, tolerance, most):
    """Solve `accelerations` on packed arrays. Return (solution, singular body or -1).

    At most `most` independent rows; Baumgarte feedback `damping` [1/s] and `stiffness` [1/s^2] (zero for none).
    """
    p = place(configuration, velocity)
    e = in_coordinates(equations(a, p, drive), p)
    gamma = e.gamma
    if p.singular >= 0:
        return Solution(np.zeros((len(a.mass), 6)), np.zeros(len(gamma)), 0, 0.0), p.singular
    if damping != 0.0 or stiffness != 0.0:
        gamma = baumgarte_gamma(e, velocity, damping, stiffness)
    return constrained_acceleration(a, p, e, generalised_force(a, p, wrench), gamma, tolerance, most), p.singular


@kernel
def baumgarte_gamma(e, velocity, damping, stiffness):
    """Return Baumgarte's right-hand side: gamma - damping (J v - target) - stiffness residual (eq. (8.30))."""
    gamma = e.gamma.copy()
    flat = velocity.copy().reshape(-1)
    for c in range(len(flat)):
        for r in range(len(gamma)):
            gamma[r] -= damping * e.jacobian_t[c, r] * flat[c]
    for r in range(len(gamma)):
        gamma[r] += damping * e.target[r]
    for r in range(len(e.residual)):
        gamma[r] -= stiffness * e.residual[r]
    return gamma


def accelerations(
    system: System,
    configuration: ArrayLike,
    velocity: ArrayLike,
    wrench: ArrayLike | None = None,
    drive: ArrayLike | None = None,
) -> Solution:
    """Return accelerations of all coordinates, multipliers, rank and conflict (theory, eqs. (8.20)-(8.22)).

    Args:
        system: n bodies and d drives.
        configuration: (n, 6) Euler or (n, 7) quaternion coordinates; see `body_kinematics`.
        velocity: (n, 6).
        wrench: (n, 6) external force at each centre of mass [N], world, and torque [N m], body; gravity is added.
        drive: (d, 2) imposed speed [rad/s] and its rate [rad/s^2] of each drive.

    Raises:
        ValueError: a body's pitch is at 90 degrees in Euler coordinates.
    """
    configuration, velocity, wrench, drive = as_float_arrays(system, configuration, velocity, wrench, drive)
    solution, singular = solve(system.arrays, configuration, velocity, wrench, drive, 0.0, 0.0, RANK_TOLERANCE, ANY)
    raise_if_singular(system, singular)
    return solution


def as_float_arrays(
    system: System, configuration: ArrayLike, velocity: ArrayLike, wrench: ArrayLike | None, drive: ArrayLike | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the arguments of `accelerations` as arrays of floats, zeros for None.

    Returns:
        configuration (n, 6) or (n, 7), velocity (n, 6), wrench (n, 6), drive (d, 2).

    Raises:
        ValueError: a shape is wrong or a number is not finite; names the argument.
    """
    n, d = len(system.bodies), len(system.drives)
    wrench = np.zeros((n, 6)) if wrench is None else np.ascontiguousarray(wrench, float)
    drive = np.zeros((d, 2)) if drive is None else np.ascontiguousarray(drive, float).reshape(d, 2)
    configuration = np.ascontiguousarray(configuration, float)
    velocity = np.ascontiguousarray(velocity, float)
    if configuration.shape not in ((n, 6), (n, 7)):
        raise ValueError(f"configuration must have shape ({n}, 6) or ({n}, 7), not {configuration.shape}")
    for name, array in (("velocity", velocity), ("wrench", wrench)):
        if array.shape != (n, 6):
            raise ValueError(f"{name} must have shape ({n}, 6), not {array.shape}")
    for name, array in (("configuration", configuration), ("velocity", velocity), ("wrench", wrench), ("drive", drive)):
        if not np.all(np.isfinite(array)):
            raise ValueError(
                f"{name} contains a number that is not finite in row {int(np.argwhere(~np.isfinite(array))[0, 0])}"
            )
    return configuration, velocity, wrench, drive


def raise_if_singular(system: System, body: int, when: str = "") -> None:
    """Raise ValueError if `body` is not -1: its Euler angles are singular."""
    if body >= 0:
        raise ValueError(
            f"{system.bodies[body].name}: pitch reached 90 degrees{when}, where XYZ Euler angles are singular: "
            "use quaternion coordinates"
        )
