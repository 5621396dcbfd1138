"""Natural logarithms, and powers.

log(x) = e ln(2) - log(c) + log(1 + f) with x = 2**e m and f = m c - 1, where c is a short reciprocal of m from a table
and f is exact (Tang, "Table-driven implementation of the logarithm function in IEEE floating-point arithmetic", ACM
TOMS 16(4), 1990). The logarithm has about 70 bits, so that x**y = exp(y log(x)) is precise too.
"""

import math

from lapwing.kernels.compiler.decorators import always_inline, noinline
from lapwing.kernels.math._primitives import (
    bits,
    from_bits,
    product,
    quick_two_sum,
    split,
    table,
    two_sum,
    with_sign,
)
from lapwing.kernels.math._tables import LN2_PARTS, LOG, LOG_START, LOGS
from lapwing.kernels.math.exponential import exp_parts, scaled

_START = bits(LOG_START)
_LN2, _LN2_LOW = LN2_PARTS
_L3, _L4, _L5, _L6, _L7, _L8, _L9 = LOG
_logs = table("logs", LOGS)  # short reciprocal, upper and lower part of its logarithm


@always_inline
def _parts(x, x_low, has_low):
    """Return log(x + x_low) as two numbers.

    Args:
        x: positive and finite.
        x_low: at most half a unit in the last place of x; 0 if x is subnormal.
        has_low: False for a constant x_low of 0, which then costs nothing.
    """
    small = x < 2.2250738585072014e-308
    i = bits(x * 18014398509481984.0 if small else x)
    e = (i - _START) >> 52
    j = 3 * (((i - _START) >> 45) & 127)
    m = from_bits(i - (e << 52))
    exponent = float(e - 54 if small else e)
    c = _logs(j)
    m1 = split(m)
    f, f_low = two_sum(m1 * c - 1.0, (m - m1) * c)
    if has_low:
        half = e >> 1
        m_low = x_low * from_bits((1023 - half) << 52) * from_bits((1023 - (e - half)) << 52)
        f, f_low = quick_two_sum(f, f_low + m_low * c)
    f1 = split(f)
    f2 = (f - f1) + f_low
    a, a_low = quick_two_sum(exponent * _LN2 + _logs(j + 1), f1)
    b, b_low = quick_two_sum(a, -0.5 * f1 * f1)
    z = f * f
    series = z * f * ((_L3 + f * _L4) + z * ((_L5 + f * _L6) + z * ((_L7 + f * _L8) + z * _L9)))
    rest = (exponent * _LN2_LOW + _logs(j + 2)) + (f2 - f2 * (f1 + 0.5 * f2))
    return b, (a_low + b_low) + (rest + series)


@noinline
def log(x):
    """Return the natural logarithm; -inf of 0, NaN of what is below."""
    if not x > 0.0:
        return -math.inf if x == 0.0 else math.nan
    if x == math.inf:
        return x
    first, rest = _parts(x, 0.0, False)
    return first + rest


@noinline
def log1p(x):
    """Return log(1 + x), precise for small x; -inf of -1, NaN of what is below."""
    if not x > -1.0:
        return -math.inf if x == -1.0 else math.nan
    if x == math.inf or abs(x) < 1e-18:
        return x
    u, u_low = two_sum(1.0, x)
    first, rest = _parts(u, u_low, True)
    return first + rest


@noinline
def pow(x, y):
    """Return x to the power y; special cases as of IEEE 754-2019, section 9.2.1 (no error is raised)."""
    if y == 0.0 or x == 1.0:
        return 1.0
    if x != x or y != y:
        return x + y
    size, order = abs(x), abs(y)
    odd = False
    if x < 0.0 or x == 0.0 or size == math.inf:
        half = 0.5 * order
        odd = half < 4503599627370496.0 and _is_integer(order) and not _is_integer(half)
    if size == 0.0 or size == math.inf:
        result = math.inf if (size == 0.0) == (y < 0.0) else 0.0
        return -result if odd and bits(x) < 0 else result
    if order == math.inf:
        return 1.0 if size == 1.0 else (math.inf if (size > 1.0) == (y > 0.0) else 0.0)
    if x < 0.0 and not _is_integer(order):
        return math.nan
    first, rest = _parts(size, 0.0, False)
    height, height_low = quick_two_sum(first, rest)
    clipped = with_sign(1e20, y) if order > 1e20 else y  # beyond, the result is 0, infinite or 1
    p, p_low = product(clipped, height)
    a, b, n = exp_parts(p, p_low + clipped * height_low if abs(p) < 800.0 else 0.0)
    result = scaled(a + b, n)
    return -result if odd else result


@always_inline
def _is_integer(x):
    """Return True if a positive number is an integer."""
    return x >= 4503599627370496.0 or (x + 4503599627370496.0) - 4503599627370496.0 == x
