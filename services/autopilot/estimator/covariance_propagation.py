"""Propagation of the covariance over one interval (theory, eqs. (3.22), (3.23), (3.61) and (3.66))."""

from typing import Any

import numpy as np

from lapwing.dynamics.vector import Mat3, Vec3, add, apply, cross, scale, subtract
from lapwing.kernels import always_inline
from lapwing.kernels.simd import load, pack4, store, unpack4
from lapwing.services.autopilot.estimator.filter_state import (
    ACCELEROMETER,
    CONSIDERED,
    CONSIDERED_IN_CALM,
    DRIFT,
    GYRO,
    GYRO_SCALE,
    LIFT,
    POSITION,
    SIZE,
    THETA,
    VARIANCE,
    VELOCITY,
    WANDER,
    Memory,
    three,
)
from lapwing.services.autopilot.estimator.static_pressure import considers_wind


@always_inline
def _transformed_rows(
    theta: Any, velocity: Any, position: Any, gyro: Any, accelerometer: Any, f: Vec3, r: Mat3, dt: float
) -> tuple[Any, Any, Any]:
    """Return the changed rows (theta, velocity, position) of F c with F = I + A dt; c is a column or SIMD columns."""
    return (
        subtract(theta, scale(dt, apply(r, gyro))),
        add(velocity, scale(dt, subtract(cross(theta, f), apply(r, accelerometer)))),
        add(position, scale(dt, velocity)),
    )


@always_inline
def _load(c: np.ndarray, width: int, i: int, j: int) -> Any:
    """Return rows i to i + 2 and columns j to j + 3 of c as SIMD vectors."""
    return load(c, width * i + j), load(c, width * (i + 1) + j), load(c, width * (i + 2) + j)


@always_inline
def _transform_rows(c: np.ndarray, width: int, first: int, stop: int, f: Vec3, r: Mat3, dt: float) -> None:
    """Compute c <- F c for the columns from `first` to `stop` of a matrix with rows of `width`."""
    for j in range(first, stop, 4):
        changed = _transformed_rows(
            _load(c, width, THETA, j), _load(c, width, VELOCITY, j), _load(c, width, POSITION, j),
            _load(c, width, GYRO, j), _load(c, width, ACCELEROMETER, j), f, r, dt,
        )  # fmt: skip
        for k in range(3):
            store(c, width * (THETA + k) + j, changed[0][k])
            store(c, width * (VELOCITY + k) + j, changed[1][k])
            store(c, width * (POSITION + k) + j, changed[2][k])


@always_inline
def propagate_covariance(c: np.ndarray, f: Vec3, r: Mat3, dt: float) -> None:
    """Compute c <- F c F^T for a symmetric c (24, 24), with the specific force f [m/s^2] and r body to world."""
    _transform_rows(c, SIZE, 0, SIZE, f, r, dt)
    for i in range(GYRO):  # F changes no row below
        row = c[i]
        theta, velocity, position = _transformed_rows(
            three(row, THETA), three(row, VELOCITY), three(row, POSITION),
            three(row, GYRO), three(row, ACCELEROMETER), f, r, dt,
        )  # fmt: skip
        for k in range(3):
            row[THETA + k], row[VELOCITY + k], row[POSITION + k] = theta[k], velocity[k], position[k]
    for i in range(SIZE):  # the two passes round differently: keep it exactly symmetric
        for j in range(min(i, GYRO)):
            c[i, j] = c[j, i]


@always_inline
def _turns(omega: Vec3, r: Mat3, dt: float) -> Any:
    """Return the columns of J, the turn [rad] by each error of the gyroscopes, as SIMD vectors with a zero."""
    x, y, z = scale(-dt, omega)
    a, b, c = (r[0], r[3], r[6]), (r[1], r[4], r[7]), (r[2], r[5], r[8])
    p, q, u = subtract(scale(y, c), scale(z, b)), subtract(scale(z, a), scale(x, c)), subtract(scale(x, b), scale(y, a))
    a, b, c = scale(x, a), scale(y, b), scale(z, c)
    return (
        pack4(a[0], a[1], a[2], 0.0), pack4(b[0], b[1], b[2], 0.0), pack4(c[0], c[1], c[2], 0.0),
        pack4(p[0], p[1], p[2], 0.0), pack4(q[0], q[1], q[2], 0.0), pack4(u[0], u[1], u[2], 0.0),
    )  # fmt: skip


@always_inline
def _lifts(f: Vec3, r: Mat3, dt: float) -> Any:
    """Return the columns of J, the velocity [m/s] by each error of the accelerometers, as SIMD vectors with a zero."""
    k = -dt * (f[0] * r[2] + f[1] * r[5] + f[2] * r[8])
    return (
        pack4(k * r[0], k * r[3], k * r[6], 0.0),
        pack4(k * r[1], k * r[4], k * r[7], 0.0),
        pack4(k * r[2], k * r[5], k * r[8], 0.0),
    )


@always_inline
def _add_half(m: Memory, row: int, column: int, columns: Any) -> None:
    """Add half of J V, the covariance of rows from `row` by the errors from `column` with these errors themselves."""
    for i in range(len(columns)):
        change = unpack4(columns[i] * (0.5 * m.considered[VARIANCE, column + i]))
        for a in range(3):
            m.considered[row + a, column + i] += change[a]


@always_inline
def _add_half_of_drift(m: Memory, drift: float) -> None:
    """Add half of J V for the biases of the gyroscopes, see `_add_half`; J is `drift` times the identity."""
    for a in range(3):
        m.considered[GYRO + a, DRIFT + a] += 0.5 * drift * m.considered[VARIANCE, DRIFT + a]


@always_inline
def _gyroscope_row(k: np.ndarray, j: int, turns: Any) -> Any:
    """Return row j of C^T J^T of the gyroscopes as a SIMD vector."""
    row = k[j]
    first = turns[0] * row[0] + turns[1] * row[1] + turns[2] * row[2]
    return first + (turns[3] * row[3] + turns[4] * row[4] + turns[5] * row[5])


@always_inline
def _accelerometer_row(k: np.ndarray, j: int, lifts: Any) -> Any:
    """Return row j of C^T J^T of the accelerometers as a SIMD vector."""
    row = k[j]
    return lifts[0] * row[LIFT] + lifts[1] * row[LIFT + 1] + lifts[2] * row[LIFT + 2]


@always_inline
def propagate_considered(m: Memory, omega: Vec3, f: Vec3, r: Mat3, drift: float, dt: float) -> None:
    """Propagate the covariance with the considered parameters, and add their effect on attitude, velocity and bias.

    Call after `propagate_covariance`; `omega` is the rate [rad/s], f the specific force [m/s^2] in the world, `drift`
    the fraction of the warm-up that happens in the interval.
    """
    c, k = m.covariance, m.considered
    _transform_rows(k, CONSIDERED, 0, CONSIDERED_IN_CALM, f, r, dt)
    if considers_wind(m):
        _transform_rows(k, CONSIDERED, CONSIDERED_IN_CALM, CONSIDERED, f, r, dt)
    turns, lifts = _turns(omega, r, dt), _lifts(f, r, dt)
    _add_half(m, THETA, GYRO_SCALE, turns)
    _add_half(m, VELOCITY, LIFT, lifts)
    _add_half_of_drift(m, drift)
    for j in range(POSITION, SIZE):
        store(c, SIZE * j + THETA, load(c, SIZE * j + THETA) + _gyroscope_row(k, j, turns))
        store(c, SIZE * j + VELOCITY, load(c, SIZE * j + VELOCITY) + _accelerometer_row(k, j, lifts))
        for i in range(POSITION):
            c[i, j] = c[j, i]
    for i in range(POSITION):  # rows and columns of both
        turn, lift = unpack4(_gyroscope_row(k, i, turns)), unpack4(_accelerometer_row(k, i, lifts))
        for a in range(3):
            c[i, THETA + a] += turn[a]
            c[i, VELOCITY + a] += lift[a]
            c[THETA + a, i] += turn[a]
            c[VELOCITY + a, i] += lift[a]
    for i in range(POSITION):  # the sums round differently: keep it exactly symmetric
        for j in range(i):
            c[i, j] = c[j, i]
    for i in range(SIZE):
        for a in range(3):
            change = drift * k[i, DRIFT + a]
            c[i, GYRO + a] += change
            c[GYRO + a, i] += change
    _add_half(m, THETA, GYRO_SCALE, turns)
    _add_half(m, VELOCITY, LIFT, lifts)
    _add_half_of_drift(m, drift)


@always_inline
def fade(m: Memory, keep: float) -> None:
    """Apply the first-order decay of the receiver's correlated error."""
    c = m.covariance
    for i in range(WANDER, WANDER + 3):
        for j in range(0, SIZE, 4):
            store(c, SIZE * i + j, keep * load(c, SIZE * i + j))
        for j in range(SIZE):
            c[j, i] *= keep
        for j in range(0, CONSIDERED, 4):
            store(m.considered, CONSIDERED * i + j, keep * load(m.considered, CONSIDERED * i + j))
