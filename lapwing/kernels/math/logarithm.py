"""Natural logarithms, and powers.

log(x) = e ln(2) - log(c) + log(1 + f) with x = 2**e m and f = m c - 1, where c is a short reciprocal of m from a table
and f is exact (Tang, "Table-driven implementation of the logarithm function in IEEE floating-point arithmetic", ACM
TOMS 16(4), 1990). The logarithm has about 70 bits, so that x**y = exp(y log(x)) is precise too.
"""

import math

from lapwing.kernels.compiler.decorators import always_inline
from lapwing.kernels.math._primitives import (
    bits,
    from_bits,
    product,
    quick_two_sum,
    select,
    split,
    table,
    two_sum,
    with_sign,
)
from lapwing.kernels.math._tables import LN2_PARTS, LOG, LOG_START, LOGS
from lapwing.kernels.math.exponential import exp_parts, scale_by_power_of_two

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
    i = bits(select(small, x * 18014398509481984.0, x))
    e = (i - _START) >> 52
    j = 3 * (((i - _START) >> 45) & 127)
    m = from_bits(i - (e << 52))
    exponent = select(small, float(e - 54), float(e))
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


@always_inline
def log(x):
    """Return the natural logarithm; -inf for 0, NaN for negative numbers."""
    first, rest = _parts(x, 0.0, False)
    result = select(x == math.inf, x, first + rest)
    return select(x > 0.0, result, select(x == 0.0, -math.inf, math.nan))


@always_inline
def log1p(x):
    """Return log(1 + x), precise for small x; -inf for -1, NaN below."""
    usual = (x > -1.0) & (x < math.inf)
    u, u_low = two_sum(1.0, select(usual, x, 0.0))
    first, rest = _parts(u, u_low, True)
    result = select(usual & (abs(x) >= 1e-18), first + rest, x)  # infinity and NaN are returned
    return select(x > -1.0, result, select(x == -1.0, -math.inf, math.nan))


@always_inline
def pow(x, y):
    """Return x to the power y; special cases as in IEEE 754-2019, section 9.2.1 (raises no error)."""
    size, order = abs(x), abs(y)
    first, rest = _parts(size, 0.0, False)
    height, height_low = quick_two_sum(first, rest)
    clipped = select(order > 1e20, with_sign(1e20, y), y)  # beyond, the result is 0, infinite or 1
    p, p_low = product(clipped, height)
    a, b, n = exp_parts(p, select(abs(p) < 800.0, p_low + clipped * height_low, 0.0))
    result = scale_by_power_of_two(a + b, n)
    is_zero, is_infinite, reaches = size == 0.0, size == math.inf, order == math.inf
    result = select(is_zero | is_infinite, select(is_zero == (y < 0.0), math.inf, 0.0), result)
    limit = select(size == 1.0, 1.0, select((size > 1.0) == (y > 0.0), math.inf, 0.0))
    result = select(reaches, limit, result)
    half = 0.5 * order
    whole = _is_integer(order)
    odd = (half < 4503599627370496.0) & whole & (not _is_integer(half))
    result = select(odd & (bits(x) < 0), -result, result)
    result = select((x < 0.0) & (not whole) & (not is_infinite) & (not reaches), math.nan, result)
    result = select((x != x) | (y != y), x + y, result)
    return select((y == 0.0) | (x == 1.0), 1.0, result)


@always_inline
def _is_integer(x):
    """Return True if a number that is not negative is an integer."""
    return (x >= 4503599627370496.0) | ((x + 4503599627370496.0) - 4503599627370496.0 == x)
