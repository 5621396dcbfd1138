"""Sequential Kalman update by scalar measurements (theory, eqs. (3.26) to (3.28) and (3.62)).

The caller fills `memory.row` with a row of the measurement matrix. Corrections accumulate in `memory.correction`, so
that all rows of a reading are linearised about the same estimate.
"""

from lapwing.dynamics.vector import Mat3, Vec3
from lapwing.kernels import always_inline, kernel, noinline
from lapwing.kernels.simd import load, splat, store
from lapwing.services.autopilot.estimator.filter_state import (
    ACCELEROMETER,
    CONSIDERED,
    LIFT,
    PRODUCT,
    ROW,
    SIZE,
    THETA,
    VARIANCE,
    Memory,
)
from lapwing.services.autopilot.estimator.static_pressure import considers_wind

FLOOR = 1e-8  # minimum measurement variance, which keeps S well above round-off with ideal instruments


@always_inline
def clear(m: Memory) -> None:
    """Clear the row of the error and of the considered parameters."""
    for i in range(0, SIZE, 4):
        store(m.row, i, splat(0.0))
    for k in range(0, CONSIDERED, 4):
        store(m.considered, CONSIDERED * ROW + k, splat(0.0))


@noinline
def innovation_variance(m: Memory, variance: float) -> float:
    """Return the innovation variance of the row; store covariance times row in `m.product`."""
    for i in range(0, SIZE, 4):
        store(m.product, i, splat(0.0))
    for j in range(SIZE):
        h = m.row[j]
        if h != 0.0:  # rows are sparse
            for i in range(0, SIZE, 4):
                store(m.product, i, load(m.product, i) + h * load(m.covariance, SIZE * j + i))
    first = load(m.considered, CONSIDERED * ROW) * load(m.considered, CONSIDERED * VARIANCE)
    second = load(m.considered, CONSIDERED * ROW + 4) * load(m.considered, CONSIDERED * VARIANCE + 4)
    third = load(m.considered, CONSIDERED * ROW + 8) * load(m.considered, CONSIDERED * VARIANCE + 8)
    fourth = load(m.considered, CONSIDERED * ROW + 12) * load(m.considered, CONSIDERED * VARIANCE + 12)
    fifth = load(m.considered, CONSIDERED * ROW + 16) * load(m.considered, CONSIDERED * VARIANCE + 16)
    for j in range(SIZE):
        h = m.row[j]
        if h != 0.0:
            first = first + h * load(m.considered, CONSIDERED * j)
            second = second + h * load(m.considered, CONSIDERED * j + 4)
            third = third + h * load(m.considered, CONSIDERED * j + 8)
            fourth = fourth + h * load(m.considered, CONSIDERED * j + 12)
            fifth = fifth + h * load(m.considered, CONSIDERED * j + 16)
    store(m.considered, CONSIDERED * PRODUCT, first)
    store(m.considered, CONSIDERED * PRODUCT + 4, second)
    store(m.considered, CONSIDERED * PRODUCT + 8, third)
    store(m.considered, CONSIDERED * PRODUCT + 12, fourth)
    store(m.considered, CONSIDERED * PRODUCT + 16, fifth)
    if considers_wind(m):
        sixth = load(m.considered, CONSIDERED * ROW + 20) * load(m.considered, CONSIDERED * VARIANCE + 20)
        for j in range(SIZE):
            sixth = sixth + m.row[j] * load(m.considered, CONSIDERED * j + 20)
        store(m.considered, CONSIDERED * PRODUCT + 20, sixth)
    total = variance + FLOOR
    for k in range(CONSIDERED):
        g = m.considered[ROW, k]
        if g != 0.0:
            total += g * m.considered[PRODUCT, k]
            for i in range(SIZE):
                m.product[i] += g * m.considered[i, k]
    for i in range(SIZE):
        if m.row[i] != 0.0:
            total += m.row[i] * m.product[i]
    return total


@kernel
def fuse(m: Memory, innovation: float, variance: float) -> float:
    """Fuse the measurement of the row. Return its normalised innovation squared."""
    return apply_update(m, innovation, innovation_variance(m, variance))


@noinline
def apply_update(m: Memory, innovation: float, s: float) -> float:
    """Fuse an innovation with variance s and its covariance with the error in `m.product`. See `fuse`."""
    y = innovation
    for i in range(SIZE):
        if m.row[i] != 0.0:
            y -= m.row[i] * m.correction[i]
    inverse = 1.0 / s
    for i in range(0, SIZE, 4):
        store(m.correction, i, load(m.correction, i) + load(m.product, i) * y * inverse)
    for i in range(SIZE):
        gain = m.product[i]
        for j in range(0, SIZE, 4):
            change = (gain * load(m.product, j)) * inverse  # exactly symmetric
            store(m.covariance, SIZE * i + j, load(m.covariance, SIZE * i + j) - change)
    first = load(m.considered, CONSIDERED * PRODUCT) * inverse
    second = load(m.considered, CONSIDERED * PRODUCT + 4) * inverse
    third = load(m.considered, CONSIDERED * PRODUCT + 8) * inverse
    fourth = load(m.considered, CONSIDERED * PRODUCT + 12) * inverse
    fifth = load(m.considered, CONSIDERED * PRODUCT + 16) * inverse
    for i in range(SIZE):
        gain, offset = m.product[i], CONSIDERED * i
        store(m.considered, offset, load(m.considered, offset) - gain * first)
        store(m.considered, offset + 4, load(m.considered, offset + 4) - gain * second)
        store(m.considered, offset + 8, load(m.considered, offset + 8) - gain * third)
        store(m.considered, offset + 12, load(m.considered, offset + 12) - gain * fourth)
        store(m.considered, offset + 16, load(m.considered, offset + 16) - gain * fifth)
    if considers_wind(m):
        sixth = load(m.considered, CONSIDERED * PRODUCT + 20) * inverse
        for i in range(SIZE):
            offset = CONSIDERED * i + 20
            store(m.considered, offset, load(m.considered, offset) - m.product[i] * sixth)
    return y * y * inverse


@kernel
def acceleration_row(m: Memory, force_world: Vec3, r: Mat3, axis: int, k: float) -> None:
    """Add k times the row of the acceleration's error: theta x f - R b - R e f_z (theory, eqs. (3.22), (3.66))."""
    x, y, z = force_world
    if axis == 0:
        theta: Vec3 = (0.0, z, -y)
    elif axis == 1:
        theta = (-z, 0.0, x)
    else:
        theta = (y, -x, 0.0)
    lift = k * (x * r[2] + y * r[5] + z * r[8])
    for i in range(3):
        m.row[THETA + i] += k * theta[i]
        m.row[ACCELEROMETER + i] -= k * r[3 * axis + i]
        m.considered[ROW, LIFT + i] -= lift * r[3 * axis + i]
