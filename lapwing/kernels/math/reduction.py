"""Reduction of an angle to a multiple of a 128th of a turn and a remainder of two doubles.

Up to 65536 rad by subtraction of multiples of a constant in four parts (Cody and Waite, "Software Manual for the
Elementary Functions", 1980); beyond by multiplication with those bits of 1 / (2 pi) that matter (Payne and Hanek,
"Radian reduction for trigonometric functions", SIGNUM Newsletter 18(1), 1983), in integers of 24 bits. The remainder of
no double is below 2**-62 of a step, so that its relative error is below 2**-64 (Muller, "Elementary Functions", 3rd
edition, section 11.3.2).
"""

from lapwing.kernels.compiler.decorators import always_inline, kernel
from lapwing.kernels.math._primitives import (
    MAGNITUDE,
    MANTISSA,
    ROUNDER,
    bits,
    product,
    quick_two_sum,
    table,
    two_sum,
)
from lapwing.kernels.math._tables import STEP_PARTS, STEPS_PER_RADIAN, TURN_LIMBS, TURN_PARTS

LARGEST = 65536.0  # [rad] for the subtraction: below 2**21 steps, whose products with 32 bits are exact

_P1, _P2, _P3, _P4 = STEP_PARTS
_TURN, _TURN_LOW = TURN_PARTS
_LIMB = 0xFFFFFF
_limb = table("turn_limbs", TURN_LIMBS)


@always_inline
def reduce_argument(x):
    """Return k modulo 128 and r + r_low with x = k pi / 64 + r + r_low and |r| <= pi / 128.

    Args:
        x: [rad] any double; of an infinity or NaN r is NaN.
    """
    if abs(x) > LARGEST:
        return reduce_large_argument(x)
    return reduce_small_argument(x)


@always_inline
def reduce_small_argument(x):
    """Return k modulo 128, r and r_low as `reduce_argument` does, for |x| <= LARGEST, without a branch."""
    shifted = x * STEPS_PER_RADIAN + ROUNDER
    k = shifted - ROUNDER
    a, a_low = two_sum(x - k * _P1, -(k * _P2))
    b, b_low = two_sum(a, -(k * _P3))
    r, r_low = quick_two_sum(b, (a_low + b_low) - k * _P4)
    return bits(shifted) & 127, r, r_low


@kernel
def reduce_large_argument(x):
    """Return k and r + r_low as `reduce_argument` does, for a magnitude of at least 2**15 (Payne and Hanek)."""
    if x - x != 0.0:
        return 0, x - x, 0.0
    magnitude = bits(x) & MAGNITUDE
    mantissa, exponent = (magnitude & MANTISSA) | (MANTISSA + 1), (magnitude >> 52) - 1075
    start = (exponent + 72) // 24  # first limb whose product is not a multiple of whole turns
    shift = exponent + 72 - 24 * start
    c = (mantissa & _LIMB) << shift
    m0, c = c & _LIMB, c >> 24
    c += ((mantissa >> 24) & _LIMB) << shift
    m1, c = c & _LIMB, c >> 24
    c += (mantissa >> 48) << shift
    m2, m3 = c & _LIMB, c >> 24
    f1 = f2 = f3 = f4 = f5 = f6 = f7 = f8 = 0
    carry = 0
    for t in range(9, -1, -1):  # turns in limbs, the last first; those before the point are dropped
        carry += m0 * _limb(start + t) + m1 * _limb(start + t + 1)
        carry += m2 * _limb(start + t + 2) + m3 * _limb(start + t + 3)
        f8, f7, f6, f5, f4, f3, f2, f1 = f7, f6, f5, f4, f3, f2, f1, carry & _LIMB
        carry >>= 24
    k = (f1 + 0x10000) >> 17
    v1 = float(((f1 - (k << 17)) << 24) + f2) * 2.0**-48
    v2 = float((f3 << 24) + f4) * 2.0**-96
    v3 = float((f5 << 24) + f6) * 2.0**-144
    v4 = float((f7 << 24) + f8) * 2.0**-192
    a, a_low = two_sum(v1, v2)
    b, b_low = two_sum(a_low, v3)
    turns, c_low = two_sum(a, b)
    low = c_low + (b_low + v4)
    r, r_low = product(turns, _TURN)
    r, r_low = quick_two_sum(r, r_low + (turns * _TURN_LOW + low * _TURN))
    if x < 0.0:
        return -k & 127, -r, -r_low
    return k & 127, r, r_low
