"""Exponential function, exp(x) - 1, and hyperbolic tangent.

exp(x) = 2**(k/64) exp(r) with |r| <= ln(2) / 128, by a table and a polynomial (Tang, "Table-driven implementation of
the exponential function in IEEE floating-point arithmetic", ACM TOMS 15(2), 1989; of expm1, TOMS 18(2), 1992).
"""

from lapwing.kernels.compiler.decorators import always_inline
from lapwing.kernels.math._primitives import (
    ROUNDER,
    bits,
    from_bits,
    quick_two_sum,
    quotient,
    select,
    split,
    table,
    two_sum,
    with_sign,
)
from lapwing.kernels.math._tables import EXP, LN2_STEP_PARTS, POWERS, STEPS_PER_LN2

_STEP, _STEP_LOW = LN2_STEP_PARTS
_E3, _E4, _E5, _E6, _E7 = EXP
_powers = table("powers", POWERS)


@always_inline
def _reduce(x):
    """Return k, and r + r_low with x = k ln(2) / 64 + r + r_low, for |x| < 1e4."""
    shifted = x * STEPS_PER_LN2 + ROUNDER
    k = shifted - ROUNDER
    return bits(shifted) - bits(ROUNDER), x - k * _STEP, -(k * _STEP_LOW)


@always_inline
def _two_to(n):
    """Return 2**n for -1022 <= n <= 1023."""
    return from_bits((n + 1023) << 52)


@always_inline
def exp_parts(x, x_low):
    """Return exp(x + x_low) as a, b and n: (a + b) 2**n with a near 1, or beyond the range of doubles one beyond it.

    Args:
        x: any double.
        x_low: rest, at most 2**-40.
    """
    clipped = select(x > 710.0, 710.0, select(x > -760.0, x, -760.0))
    k, r, r_low = _reduce(clipped)
    r_low += x_low
    t1, t2 = _powers(2 * (k & 63)), _powers(2 * (k & 63) + 1)
    t = t1 + t2
    r_all = r + r_low
    r1 = split(r_all)
    r2 = (r - r1) + r_low
    p = t1 * r1
    first = t1 + p
    z = r_all * r_all
    growth = z * (0.5 + r_all * ((_E3 + r_all * _E4) + z * ((_E5 + r_all * _E6) + z * _E7)))
    rest = (p - (first - t1)) + ((t2 + (t * r2 + t2 * r1)) + t * growth)
    return first, rest, k >> 6


@always_inline
def scale_by_power_of_two(value, n):
    """Return value * 2**n for -2000 <= n <= 2000, rounded once if value is exact."""
    half = n >> 1
    return value * _two_to(half) * _two_to(n - half)


@always_inline
def exp(x):
    """Return the exponential function."""
    first, rest, n = exp_parts(x, 0.0)
    return select(x != x, x, scale_by_power_of_two(first + rest, n))


@always_inline
def _half_expm1(x):
    """Return (exp(x) - 1) / 2 as two numbers, for x of at most 710; of x < -40 it is wrong but finite."""
    k, r, r_low = _reduce(x)
    scale = _two_to((k >> 6) - 1)  # 2**1023 at most
    t1, t2 = _powers(2 * (k & 63)) * scale, _powers(2 * (k & 63) + 1) * scale
    r_all = r + r_low
    r1 = split(r_all)
    r2 = (r - r1) + r_low
    base, base_low = two_sum(t1, -0.5)
    p = t1 * r1
    a, a_low = two_sum(base, p)
    q = t1 * (0.5 * r1 * r1)  # exact where exp(x) - 1 is small
    b, b_low = two_sum(a, q)
    t = t1 + t2
    z = r_all * r_all
    growth = z * r_all * ((_E3 + r_all * _E4) + z * ((_E5 + r_all * _E6) + z * _E7))
    rest = t2 + (t2 * (r_all + 0.5 * z) + t1 * (r2 + r2 * (r1 + 0.5 * r2)))
    return b, ((base_low + a_low) + b_low) + (rest + t * growth)


@always_inline
def expm1(x):
    """Return exp(x) - 1, precise for small x."""
    clipped = select(x > 710.0, 710.0, select(x > -40.0, x, -40.0))
    first, rest = _half_expm1(clipped)
    result = select(x < -40.0, -1.0, 2.0 * (first + rest))
    return select((abs(x) < 1e-17) | (x != x), x, result)


@always_inline
def tanh(x):
    """Return the hyperbolic tangent."""
    size = select(abs(x) < 22.0, abs(x), 22.0)
    e, e_low = _half_expm1(2.0 * size)
    e, e_low = quick_two_sum(e, e_low)
    d, d_low = two_sum(e, 1.0)
    first, rest = quotient(e, e_low, d, d_low + e_low)
    result = select(size < 22.0, with_sign(first + rest, x), with_sign(1.0, x))
    return select((abs(x) < 1e-300) | (x != x), x, result)
