"""Projection of a state onto its constraints, on position and velocity level (theory, section 8.6).

`project` applies the smallest correction in the metric of the masses. `partition` keeps the independent
coordinates and velocities that the integration produced and solves for the dependent ones: the paper's
generalised coordinate partitioning. Baumgarte's feedback is `augmented.baumgarte_gamma`.
"""

import numpy as np

from lapwing.dynamics.multibody import pivoted_qr
from lapwing.dynamics.multibody.augmented import ANY, RANK_TOLERANCE, divide_root_transposed, factor_rows
from lapwing.dynamics.multibody.body_kinematics import add_increment, place
from lapwing.dynamics.multibody.constraints import equations, in_coordinates, velocity_defect
from lapwing.kernels import kernel, noinline

NONE, PARTITION, PROJECTION, BAUMGARTE = 0, 1, 2, 3
NAMES = {"none": NONE, "partitioning": PARTITION, "projection": PROJECTION, "baumgarte": BAUMGARTE}

ENOUGH = 1e-13  # position defect at which Newton's iteration stops: round-off of coordinates of a few metres
ITERATIONS = 8


@kernel
def largest(x):
    """Return the largest absolute value; NaN if there is one, 0 for an empty array."""
    out = 0.0
    for value in x:
        if not abs(value) <= out:
            out = abs(value)
    return out


@kernel
def rows(a, configuration, velocity, drive):
    """Return (placement, equations) at a state, in its own coordinates."""
    p = place(configuration, velocity)
    return p, in_coordinates(equations(a, p, drive), p)


@kernel
def defects(a, configuration, velocity, drive):
    """Return the largest defect of all constraints: (position level [m, -], velocity level [m/s, rad/s])."""
    _, e = rows(a, configuration, velocity, drive)
    return largest(e.residual), largest(velocity_defect(e, velocity))


@kernel
def ranks(a, configuration, velocity, drive):
    """Return (rank of the holonomic rows, rank of all rows) at a consistent state."""
    p, e = rows(a, configuration, velocity, drive)
    _, _, holonomic = factor_rows(a, p, e, len(e.residual), RANK_TOLERANCE, ANY)
    _, _, every = factor_rows(a, p, e, len(e.target), RANK_TOLERANCE, ANY)
    return holonomic.rank, every.rank


@kernel
def _tolerance(e):
    """Return the rank tolerance off the constraints: dependent rows have independent parts of defect order."""
    return max(RANK_TOLERANCE, min(10.0 * largest(e.residual), 1e-3))


@noinline
def project(a, configuration, velocity, drive, ranks):
    """Return the nearest consistent state in the metric of the mass matrix (theory, eqs. (8.31), (8.32)).

    `ranks`: upper bounds of the rank of the holonomic rows and of all rows.
    """
    holonomic = 5 * len(a.joint_bodies)
    p, e = rows(a, configuration, velocity, drive)
    for _ in range(ITERATIONS):
        if largest(e.residual) < ENOUGH:
            break
        root, rotational, f = factor_rows(a, p, e, holonomic, _tolerance(e), ranks[0])
        y, _, _ = pivoted_qr.shortest(f, -e.residual)
        divide_root_transposed(root, rotational, y)
        configuration = add_increment(configuration, y.reshape(-1, 6))
        p, e = rows(a, configuration, velocity, drive)
    if len(e.target) > 0:
        root, rotational, f = factor_rows(a, p, e, len(e.target), _tolerance(e), ranks[1])
        y, _, _ = pivoted_qr.shortest(f, -velocity_defect(e, velocity))
        divide_root_transposed(root, rotational, y)
        velocity = velocity + y.reshape(-1, 6)
    return configuration, velocity


@kernel
def _dependent(f, width):
    """Return a mask of the dependent coordinates: the columns of J that are independent in its factorisation."""
    mask = np.zeros(width, np.bool_)
    for k in range(f.rank):
        mask[f.order[k]] = True
    return mask


@kernel
def _correction(jacobian, mask, defect, tolerance, most):
    """Return the increment of the masked coordinates alone that removes the defect, shape (6 n,)."""
    reduced = jacobian.copy()
    for c in range(reduced.shape[1]):
        if not mask[c]:
            reduced[:, c] = 0.0
    return pivoted_qr.basic(pivoted_qr.factor(reduced, tolerance, most), -defect)


@noinline
def partition(a, configuration, velocity, drive, ranks):
    """Correct the dependent coordinates by generalised coordinate partitioning (theory, eqs. (8.33), (8.34)).

    Column pivoting of the Jacobian selects the dependent coordinates, which Newton's iteration corrects; then the
    velocities. See `project` for `ranks`.
    """
    holonomic, width = 5 * len(a.joint_bodies), 6 * len(a.mass)
    _, e = rows(a, configuration, velocity, drive)
    if holonomic > 0:
        jacobian = np.ascontiguousarray(e.jacobian_t[:, :holonomic].T)
        mask = _dependent(pivoted_qr.factor(jacobian, _tolerance(e), ranks[0]), width)
        for _ in range(ITERATIONS):
            if largest(e.residual) < ENOUGH:
                break
            change = _correction(jacobian, mask, e.residual, _tolerance(e), ranks[0])
            configuration = add_increment(configuration, change.reshape(-1, 6))
            _, e = rows(a, configuration, velocity, drive)
            jacobian = np.ascontiguousarray(e.jacobian_t[:, :holonomic].T)
    if len(e.target) > 0:
        jacobian = np.ascontiguousarray(e.jacobian_t.T)
        mask = _dependent(pivoted_qr.factor(jacobian, _tolerance(e), ranks[1]), width)
        change = _correction(jacobian, mask, velocity_defect(e, velocity), _tolerance(e), ranks[1])
        velocity = velocity + change.reshape(-1, 6)
    return configuration, velocity
