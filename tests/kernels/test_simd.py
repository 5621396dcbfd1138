"""Lanes equal scalar floats bit for bit."""

import math

import numpy as np

from lapwing.dynamics import vector
from lapwing.dynamics.lie import quaternion
from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.kernels import kernel
from lapwing.kernels.simd import (
    any_above,
    deinterleave,
    horizontal_sum,
    interleave,
    load,
    pack4,
    select,
    select_vector,
    splat,
    sqrt,
    store,
    unpack4,
)


@kernel
def formula(a, b, s):
    return ((a + b) * s - 2.0 / a) / (b - s * a) + (1.0 - -b)


@kernel
def on_lanes(a, b, s):
    return unpack4(formula(pack4(a[0], a[1], a[2], a[3]), pack4(b[0], b[1], b[2], b[3]), s))


def test_lane_arithmetic_equals_float_arithmetic():
    rng = np.random.default_rng(1)
    for _ in range(50):
        a, b = (tuple(row) for row in rng.normal(size=(2, 4)).tolist())
        assert on_lanes(a, b, 0.7) == tuple(formula(x, y, 0.7) for x, y in zip(a, b, strict=True))


@kernel
def turned(four, v):
    q = interleave(four)
    R = quaternion.rotation_matrix(quaternion.multiply(quaternion.conjugate(q), q))
    return deinterleave((q, vector.apply(R, v), vector.cross(v, quaternion.rotate(q, v))))


def test_interleaved_trees_keep_order():
    rng = np.random.default_rng(2)
    four = tuple(Quaternion(*row) for row in rng.normal(size=(4, 4)).tolist())
    v = (0.1, -0.4, 0.8)
    for q, (same, _, crossed) in zip(four, turned(four, v), strict=True):
        assert same == q
        assert crossed == vector.cross(v, quaternion.rotate(q, v))


@kernel
def chosen(flag, x):
    f = interleave(flag)
    return unpack4(select(f, sqrt(interleave(x)), -1.0)), horizontal_sum(interleave(x))


def test_select_sqrt_and_horizontal_sum():
    x = (4.0, 9.0, 2.0, -1.0)
    picked, whole = chosen((1.0, 0.0, 0.5, -1.0), x)
    assert picked == (2.0, -1.0, math.sqrt(2.0), -1.0)
    assert whole == 14.0


@kernel
def vectors(flag, a, b):
    f = interleave(flag)
    return deinterleave(select_vector(f, interleave(a), b)), any_above(f)


def test_vector_selection_and_any_predicate():
    a, b = ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (7.0, 8.0, 9.0), (10.0, 11.0, 12.0)), (0.0, -1.0, -2.0)
    assert vectors((0.0, 1.0, -1.0, math.nan), a, b) == ((b, a[1], b, b), True)
    assert vectors((0.0, -0.0, -1.0, math.nan), a, b) == ((b, b, b, b), False)


@kernel
def moved(a):
    store(a, 5, load(a, 1) + splat(10.0))
    return a


def test_load_and_store_access_array():
    a = np.arange(12.0).reshape(3, 4)
    np.testing.assert_array_equal(moved(a).ravel(), [0, 1, 2, 3, 4, 11, 12, 13, 14, 9, 10, 11])
