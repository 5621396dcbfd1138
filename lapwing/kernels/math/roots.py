"""Cube root, and length of a vector in the plane.

The length is a square root, which IEEE 754 rounds correctly, corrected by the residual of its exact square (Dekker
1971). The cube root is a guess of 17 bits, whose cube is exact, corrected by a series in the residual.
"""

import math

from lapwing.kernels.compiler.decorators import always_inline
from lapwing.kernels.math._primitives import MANTISSA, bits, exact_square, from_bits, quick_two_sum, with_sign
from lapwing.kernels.math._tables import CUBE_ROOT

_Q0, _Q1, _Q2, _Q3, _Q4, _Q5 = CUBE_ROOT
_ROUNDER_17 = 103079215104.0  # 1.5 * 2**36: rounds numbers between 1 and 2 to 17 bits


@always_inline
def hypot(x, y):
    """Return sqrt(x**2 + y**2) without overflow; inf if either is infinite."""
    a, b = abs(x), abs(y)
    if a == math.inf or b == math.inf:
        return math.inf
    if a < b:
        a, b = b, a
    scale, back = 1.0, 1.0
    if a > 2.0**400:
        scale, back = 2.0**-600, 2.0**600
    elif a < 2.0**-400:
        scale, back = 2.0**600, 2.0**-600
    p, p_low = exact_square(a * scale)
    q, q_low = exact_square(b * scale)
    s, s_low = quick_two_sum(p, q)
    w, w_low = quick_two_sum(s, s_low + (p_low + q_low))
    root = math.sqrt(w)
    u, u_low = exact_square(root)
    return (root + 0.5 * (((w - u) - u_low) + w_low) / (root if root > 0.0 else 1.0)) * back


@always_inline
def cbrt(x):
    """Return the cube root."""
    if x - x != 0.0 or x == 0.0:
        return x
    size = abs(x)
    small = size < 2.2250738585072014e-308
    i = bits(size * 18014398509481984.0 if small else size)
    exponent = (i >> 52) - (1077 if small else 1023)
    third = ((exponent + 3000) * 21846 >> 16) - 1000  # a third of the exponent, rounded down
    m = from_bits((i & MANTISSA) | ((1023 + exponent - 3 * third) << 52))
    y = _Q0 + m * (_Q1 + m * (_Q2 + m * (_Q3 + m * (_Q4 + m * _Q5))))
    y = y - (y * y * y - m) / (3.0 * (y * y))
    y = (y + _ROUNDER_17) - _ROUNDER_17
    cube = y * y * y
    e = (m - cube) / cube
    correction = y * e * (1.0 / 3.0 - e * (1.0 / 9.0 - e * (5.0 / 81.0 - e * (10.0 / 243.0))))
    return with_sign((y + correction) * from_bits((third + 1023) << 52), x)


@always_inline
def square(x):
    """Return x * x (in Python, x**2 is computed by the C library)."""
    return x * x
