"""Vectors of three floats and 3x3 matrices as plain tuples: no allocation in compiled code.

A vector is `(x, y, z)`; a matrix is nine floats in row order.
"""

import math

from lapwing.kernels import always_inline

Vec3 = tuple[float, float, float]
Mat3 = tuple[float, float, float, float, float, float, float, float, float]

ZERO: Vec3 = (0.0, 0.0, 0.0)
NOTHING: Vec3 = (-0.0, -0.0, -0.0)  # neutral element of addition, also for the sign of 0.0: the compiler removes it
IDENTITY: Mat3 = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


@always_inline
def add(a, b):
    """Return a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@always_inline
def subtract(a, b):
    """Return a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@always_inline
def scale(s, a):
    """Return s a for a scalar s."""
    return (s * a[0], s * a[1], s * a[2])


@always_inline
def multiply(a, b):
    """Return the elementwise product."""
    return (a[0] * b[0], a[1] * b[1], a[2] * b[2])


@always_inline
def divide(a, b):
    """Return the elementwise quotient."""
    return (a[0] / b[0], a[1] / b[1], a[2] / b[2])


@always_inline
def dot(a, b):
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@always_inline
def cross(a, b):
    """Return a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@always_inline
def norm(a):
    """Return the Euclidean length."""
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@always_inline
def apply(m, a):
    """Return m a for a 3x3 matrix m in row order."""
    return (
        m[0] * a[0] + m[1] * a[1] + m[2] * a[2],
        m[3] * a[0] + m[4] * a[1] + m[5] * a[2],
        m[6] * a[0] + m[7] * a[1] + m[8] * a[2],
    )


@always_inline
def apply_transposed(m, a):
    """Return transpose(m) a for a 3x3 matrix m in row order."""
    return (
        m[0] * a[0] + m[3] * a[1] + m[6] * a[2],
        m[1] * a[0] + m[4] * a[1] + m[7] * a[2],
        m[2] * a[0] + m[5] * a[1] + m[8] * a[2],
    )


@always_inline
def matmul(m, n):
    """Return m n for 3x3 matrices in row order."""
    return (
        m[0] * n[0] + m[1] * n[3] + m[2] * n[6],
        m[0] * n[1] + m[1] * n[4] + m[2] * n[7],
        m[0] * n[2] + m[1] * n[5] + m[2] * n[8],
        m[3] * n[0] + m[4] * n[3] + m[5] * n[6],
        m[3] * n[1] + m[4] * n[4] + m[5] * n[7],
        m[3] * n[2] + m[4] * n[5] + m[5] * n[8],
        m[6] * n[0] + m[7] * n[3] + m[8] * n[6],
        m[6] * n[1] + m[7] * n[4] + m[8] * n[7],
        m[6] * n[2] + m[7] * n[5] + m[8] * n[8],
    )


@always_inline
def transpose(m):
    """Return the transpose of a 3x3 matrix in row order."""
    return (m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8])


@always_inline
def pair(_, a, b):
    """Return (a, b), for `map_tuple` of two tuples."""
    return a, b


@always_inline
def product(_, a, b):
    """Return a b, for `map_tuple` of two tuples."""
    return a * b


@always_inline
def first(_, members, same):
    """Return the first member, for `map_tuple` of a tuple of tuples."""
    return members[0]


@always_inline
def second(_, members, same):
    """Return the second member, for `map_tuple` of a tuple of tuples."""
    return members[1]
