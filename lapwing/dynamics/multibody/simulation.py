"""Initial states and motion of a general system: the classical Runge-Kutta method on the index-1 equations.

The state is an array of any number of bodies in either coordinates, so it does not use the state trees of
`lapwing.dynamics.integrators`, which the five bodies on the fast path use (see `five_bodies`).
"""

from typing import NamedTuple

import numpy as np

from lapwing.dynamics.multibody.augmented import ANY, RANK_TOLERANCE, as_float_arrays, raise_if_singular, solve
from lapwing.dynamics.multibody.body_kinematics import add_increment, configuration_rate
from lapwing.dynamics.multibody.constraints import velocity_defect
from lapwing.dynamics.multibody.stabilisation import (
    BAUMGARTE,
    NAMES,
    PARTITION,
    PROJECTION,
    defects,
    partition,
    project,
    ranks,
    rows,
)
from lapwing.kernels import kernel

CONSISTENT = 1e-9  # [m, -, m/s, rad/s] largest defect of a consistent state
NEAR = 0.2  # largest position defect that is corrected: beyond it, another assembly of the mechanism may be found


class Recorded(NamedTuple):
    """Records of `simulate`, including the initial state."""

    time: np.ndarray  # (s,) [s]
    configuration: np.ndarray  # (s, n, 6 or 7)
    velocity: np.ndarray  # (s, n, 6)
    position_defect: np.ndarray  # (s,) largest constraint violation [m, -]
    velocity_defect: np.ndarray  # (s,) [m/s, rad/s]


@kernel
def _drive_at(drive, t):
    """Return the speed and rate of every drive at time t, for a constant rate."""
    now = drive.copy()
    for k in range(len(drive)):
        now[k, 0] += drive[k, 1] * t
    return now


@kernel
def _along(x, h, k):
    """Return x + h k."""
    out = x.copy()
    for i in range(x.shape[0]):
        for j in range(x.shape[1]):
            out[i, j] += h * k[i, j]
    return out


@kernel
def _rk4_update(x, h, k1, k2, k3, k4):
    """Return x + h (k1 + 2 k2 + 2 k3 + k4) / 6."""
    out = x.copy()
    for i in range(x.shape[0]):
        for j in range(x.shape[1]):
            out[i, j] += (h / 6.0) * (k1[i, j] + 2.0 * (k2[i, j] + k3[i, j]) + k4[i, j])
    return out


@kernel
def _step(a, q, v, wrench, drive, t, h, damping, stiffness, ranks):
    """Take one RK4 step and normalise the quaternions. Return (q, v, singular body or -1)."""
    half = 0.5 * h
    s1, b1 = solve(a, q, v, wrench, _drive_at(drive, t), damping, stiffness, RANK_TOLERANCE, ranks[1])
    k1, a1 = configuration_rate(q, v), s1.acceleration
    q2, v2 = _along(q, half, k1), _along(v, half, a1)
    s2, b2 = solve(a, q2, v2, wrench, _drive_at(drive, t + half), damping, stiffness, RANK_TOLERANCE, ranks[1])
    k2, a2 = configuration_rate(q2, v2), s2.acceleration
    q3, v3 = _along(q, half, k2), _along(v, half, a2)
    s3, b3 = solve(a, q3, v3, wrench, _drive_at(drive, t + half), damping, stiffness, RANK_TOLERANCE, ranks[1])
    k3, a3 = configuration_rate(q3, v3), s3.acceleration
    q4, v4 = _along(q, h, k3), _along(v, h, a3)
    s4, b4 = solve(a, q4, v4, wrench, _drive_at(drive, t + h), damping, stiffness, RANK_TOLERANCE, ranks[1])
    k4, a4 = configuration_rate(q4, v4), s4.acceleration
    q, v = _rk4_update(q, h, k1, k2, k3, k4), _rk4_update(v, h, a1, a2, a3, a4)
    return add_increment(q, np.zeros(v.shape)), v, max(max(b1, b2), max(b3, b4))


def simulate(
    system, configuration, velocity, step, steps, stabilisation="projection", *,
    wrench=None, drive=None, record_every=1, rate=10.0,
) -> Recorded:  # fmt: skip
    """Integrate a system from a consistent state.

    Args:
        system: from `system.assemble`.
        configuration: (n, 6) Euler or (n, 7) quaternion coordinates; velocity: (n, 6); see `body_kinematics`.
        step: step size [s]; steps: number of steps.
        stabilisation: "none", "baumgarte", "partitioning" or "projection".
        wrench: (n, 6) constant external load, see `augmented.accelerations`.
        drive: (d, 2) imposed speed at t = 0 [rad/s] and constant rate [rad/s^2].
        record_every: steps between records.
        rate: Baumgarte's feedback rate [1/s], critically damped.

    The rank of the constraints at the start bounds it for the whole motion: off the constraints, round-off would make
    redundant rows independent and lock the mechanism. Therefore do not start in a singular position.

    Raises:
        ValueError: bad shapes or numbers, an unknown stabilisation, Euler angles that reached a pitch of 90 degrees.
    """
    configuration, velocity, wrench, drive = as_float_arrays(system, configuration, velocity, wrench, drive)
    if not step > 0.0:
        raise ValueError(f"step must be positive, not {step}")
    if stabilisation not in NAMES:
        raise ValueError(f"unknown stabilisation {stabilisation!r}: choose one of {', '.join(NAMES)}")
    code = NAMES[stabilisation]
    damping, stiffness = (2.0 * rate, rate * rate) if code == BAUMGARTE else (0.0, 0.0)
    records = steps // record_every + 1
    out = Recorded(
        np.zeros(records), np.zeros((records, *configuration.shape)), np.zeros((records, *velocity.shape)),
        np.zeros(records), np.zeros(records),
    )  # fmt: skip
    a, bounds = system.arrays, ranks(system.arrays, configuration, velocity, drive)
    # a Python loop: its compilation would take longer than any motion of a general system
    last = (records - 1) * record_every
    for i in range(last + 1):
        now = _drive_at(drive, i * step)
        if i > 0 and code == PROJECTION:
            configuration, velocity = project(a, configuration, velocity, now, bounds)
        elif i > 0 and code == PARTITION:
            configuration, velocity = partition(a, configuration, velocity, now, bounds)
        if i % record_every == 0:
            record = i // record_every
            out.time[record], out.configuration[record], out.velocity[record] = i * step, configuration, velocity
            out.position_defect[record], out.velocity_defect[record] = defects(a, configuration, velocity, now)
        if i == last:
            break
        configuration, velocity, singular = _step(
            a, configuration, velocity, wrench, drive, i * step, step, damping, stiffness, bounds
        )
        raise_if_singular(system, singular, f" at t = {i * step:.6g} s")
    return out


def check(system, configuration, velocity, drive=None, tolerance=CONSISTENT) -> None:
    """Raise ValueError with every violated row and its defect if a state does not satisfy its constraints."""
    configuration, velocity, _, drive = as_float_arrays(system, configuration, velocity, None, drive)
    p, e = rows(system.arrays, configuration, velocity, drive)
    raise_if_singular(system, p.singular)
    names, holonomic = system.row_names(), len(e.residual)
    bad = [f"{names[r]} (position, {e.residual[r]:.3g})" for r in np.flatnonzero(np.abs(e.residual) > tolerance)]
    slip = velocity_defect(e, velocity)
    bad += [f"{names[r]} (velocity, {slip[r]:.3g})" for r in np.flatnonzero(np.abs(slip) > tolerance)]
    if bad:
        raise ValueError(f"initial state violates {len(bad)} of {holonomic + len(slip)} conditions: {'; '.join(bad)}")


def consistent(system, configuration, velocity, drive=None):
    """Return the nearest consistent (configuration, velocity) in the metric of the masses.

    Raises:
        ValueError: a joint is apart by more than `NEAR`, or no state satisfies all rows; names the violated rows.
    """
    configuration, velocity, _, drive = as_float_arrays(system, configuration, velocity, None, drive)
    p, e = rows(system.arrays, configuration, velocity, drive)
    raise_if_singular(system, p.singular)
    if len(e.residual) and np.max(np.abs(e.residual)) > NEAR:
        check(system, configuration, velocity, drive, NEAR)
    configuration, velocity = project(system.arrays, configuration, velocity, drive, (ANY, ANY))
    check(system, configuration, velocity, drive)
    return configuration, velocity
