"""Arc tangent, arc sine and arc cosine.

atan(n / d) = atan(c) + atan((n - c d) / (d + c n)) with c the multiple of 1/64 nearest to n / d (Muller, "Elementary
Functions", 3rd edition, section 6.3 on table-based methods; the quotient to 75 bits after Dekker 1971). Arc sine and
cosine are arc tangents of x and sqrt(1 - x**2), whose square is exact as the sum of two doubles.
"""

import math

from lapwing.kernels.compiler.decorators import always_inline
from lapwing.kernels.math._primitives import (
    ROUNDER,
    bits,
    exact_square,
    is_negative,
    quick_two_sum,
    quotient,
    select,
    split,
    table,
    two_sum,
    with_sign,
)
from lapwing.kernels.math._tables import ATAN, ATANS, HALF_PARTS, QUARTER_PARTS

_QUARTER, _QUARTER_LOW = QUARTER_PARTS
_HALF, _HALF_LOW = HALF_PARTS
_A3, _A5, _A7, _A9 = ATAN
_atans = table("atans", ATANS)


@always_inline
def _angle(n, n_low, d, d_low, ratio):
    """Return atan((n + n_low) / (d + d_low)) as upper and lower part of a table value, 26 bits, and a rest.

    Args:
        n: numerator, 0 <= n <= d.
        n_low: rest of the numerator.
        d: denominator, neither huge nor tiny.
        d_low: rest of the denominator.
        ratio: n / d.
    """
    shifted = ratio * 64.0 + ROUNDER
    c, j = (shifted - ROUNDER) * 0.015625, 2 * (bits(shifted) & 127)
    d1, n1 = split(d), split(n)
    a, a_low = two_sum(n, -(c * d1))
    above, above_low = two_sum(a, -(c * (d - d1)))
    below, below_low = quick_two_sum(d, c * n1)
    above_low += a_low + (n_low - c * d_low)
    below_low += c * (n - n1) + (d_low + c * n_low)
    first, rest = quotient(above, above_low, below, below_low)
    h = first + rest
    z = h * h
    return _atans(j), _atans(j + 1), first, rest + h * z * (_A3 + z * (_A5 + z * (_A7 + z * _A9)))


@always_inline
def _add_to_base(base, base_low, sign, t, t_low, first, rest):
    """Return base + sign * (t + first) of numbers with rests."""
    a, a_low = quick_two_sum(base, sign * t)
    b, b_low = quick_two_sum(a, sign * first)
    return b + ((a_low + b_low) + (base_low + sign * (t_low + rest)))


@always_inline
def _direction(y, y_low, x, x_low, back, unscaled):
    """Return the angle of a point with coordinates of two doubles each, above or on the x axis.

    Args:
        y: >= 0, with x neither huge nor tiny.
        y_low: rest of y.
        x: >= 0, not 0 if y is.
        x_low: rest of x.
        back: True if the first coordinate is -x.
        unscaled: the smaller of y and x divided by the larger.
    """
    steep = y > x
    n, n_low, d, d_low = (x, x_low, y, y_low) if steep else (y, y_low, x, x_low)
    t, t_low, first, rest = _angle(n, n_low, d, d_low, unscaled)
    tiny = unscaled < 1e-20
    t, t_low = select(tiny, 0.0, t), select(tiny, 0.0, t_low)
    first, rest = select(tiny, unscaled, first), select(tiny, 0.0, rest)
    base = _QUARTER if steep else (_HALF if back else 0.0)
    base_low = _QUARTER_LOW if steep else (_HALF_LOW if back else 0.0)
    return _add_to_base(base, base_low, 1.0 if steep == back else -1.0, t, t_low, first, rest)


@always_inline
def atan2(y, x):
    """Return the angle of the point (x, y) [rad] in [-pi, pi]; zeros and infinities as in C."""
    a, b = abs(x), abs(y)
    unknown, infinite = (x != x) | (y != y), (a == math.inf) | (b == math.inf)
    a = select(infinite, select(a == math.inf, 1.0, 0.0), a)
    b = select(infinite, select(b == math.inf, 1.0, 0.0), b)
    a = select(((a == 0.0) & (b == 0.0)) | unknown, 1.0, a)
    b = select(unknown, 0.0, b)
    ratio = b / a if b <= a else a / b
    larger = a if b <= a else b
    scale = 2.0**-600 if larger > 2.0**400 else (2.0**600 if larger < 2.0**-400 else 1.0)
    angle = with_sign(_direction(b * scale, 0.0, a * scale, 0.0, is_negative(x), ratio), y)
    return select(unknown, x + y, angle)


@always_inline
def atan(x):
    """Return the arc tangent [rad]."""
    size = select(x == x, abs(x), 0.0)
    size = select(size > 1e20, 1e20, size)  # beyond, the result is a quarter turn
    ratio = size if size <= 1.0 else 1.0 / size
    result = with_sign(_direction(size, 0.0, 1.0, 0.0, False, ratio), x)
    return select(x == x, result, x)


@always_inline
def _other_leg(x):
    """Return sqrt(1 - x**2) as two doubles, for 0 <= x <= 1."""
    p, p_low = exact_square(x)
    a, a_low = two_sum(1.0, -p)
    w, w_low = two_sum(a, a_low - p_low)
    root = math.sqrt(w)
    q, q_low = exact_square(root)
    return root, 0.5 * (((w - q) - q_low) + w_low) / (root if root > 0.0 else 1.0)


@always_inline
def asin(x):
    """Return the arc sine [rad]; NaN beyond [-1, 1]."""
    known = abs(x) <= 1.0
    size = select(known, abs(x), 0.0)
    leg, leg_low = _other_leg(size)
    ratio = size / leg if size <= leg else leg / size
    return select(known, with_sign(_direction(size, 0.0, leg, leg_low, False, ratio), x), math.nan)


@always_inline
def acos(x):
    """Return the arc cosine [rad] in [0, pi]; NaN beyond [-1, 1]."""
    known = abs(x) <= 1.0
    size = select(known, abs(x), 0.0)
    leg, leg_low = _other_leg(size)
    ratio = size / leg if size <= leg else leg / size
    return select(known, _direction(leg, leg_low, size, 0.0, is_negative(x), ratio), math.nan)
