"""Derivatives with respect to a^2 of the ratios of lapwing/dynamics/lie/ratios.py: what SE(3) needs beyond SO(3)."""

from lapwing.dynamics.lie.ratios import (
    COSINE,
    COTANGENT,
    CUBIC,
    cosine_ratio,
    cubic_ratio,
    half_angle,
    polynomial,
    sine_ratio,
)
from lapwing.kernels import always_inline

COSINE_SLOPE = tuple(k * c for k, c in enumerate(COSINE))[1:]
CUBIC_SLOPE = tuple(k * c for k, c in enumerate(CUBIC))[1:]
COTANGENT_SLOPE = tuple(k * c for k, c in enumerate(COTANGENT))[1:]


@always_inline
def cosine_slope(square):
    """Return d/d(a^2) of (1 - cos(a)) / a^2 (theory.md, eq. (5.18))."""
    if square < 1.0:
        return polynomial(COSINE_SLOPE, square)
    return (0.5 * sine_ratio(square) - cosine_ratio(square)) / square


@always_inline
def cubic_slope(square):
    """Return d/d(a^2) of (a - sin(a)) / a^3 (theory.md, eq. (5.18))."""
    if square < 1.0:
        return polynomial(CUBIC_SLOPE, square)
    return 0.5 * (cosine_ratio(square) - 3.0 * cubic_ratio(square)) / square


@always_inline
def cotangent_slope(v):
    """Return d/d(a^2) of (1 - (a/2) cot(a/2)) / a^2 at a = |v|, with its double pole at 2 pi (eq. (5.18))."""
    square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    if square < 1.0:
        return polynomial(COTANGENT_SLOPE, square)
    half, sine, cosine = half_angle(v)
    turned = half * cosine / sine
    return (0.125 / (sine * sine) - (1.0 - 0.5 * turned) / square) / square
