"""Error models of instruments: white noise, first-order bias walk, saturation, quantisation (theory, section 3.2).

Densities are one-sided: a density n [u/sqrt(Hz)] sampled at f [Hz] gives the standard deviation n sqrt(f/2), and the
Allan deviation n / sqrt(2 tau).
"""

import numpy as np

from lapwing.dynamics.vector import Mat3, Vec3, add, scale
from lapwing.kernels import always_inline, math

ALLAN_PEAK = 0.6173643  # largest Allan deviation of a first-order process of unit deviation
ALLAN_PEAK_TIME = 1.8926178  # correlation times at which it is reached


def density_of_random_walk(walk_per_sqrt_hour: float) -> float:
    """Return the one-sided density [u/sqrt(Hz)] of an angle (velocity) random walk in u s/sqrt(h) (eq. (3.11))."""
    return walk_per_sqrt_hour * math.sqrt(2.0) / 60.0


@always_inline
def white_deviation(density: float, rate: float) -> float:
    """Return the standard deviation of a sample of white noise with this one-sided density (theory, eq. (3.10))."""
    return density * math.sqrt(0.5 * rate)


@always_inline
def sample_variance(density: float, step: float, rate: float) -> float:
    """Return the variance of a sample: white noise plus rounding to multiples of step."""
    return 0.5 * rate * density * density + step * step / 12.0


@always_inline
def walk_deviation(instability: float) -> float:
    """Return the standard deviation of a first-order bias whose Allan deviation peaks at `instability` (eq. (3.13))."""
    return instability / ALLAN_PEAK


@always_inline
def walk(bias: Vec3, deviation: float, correlation_time: float, rate: float, draw: Vec3) -> Vec3:
    """Return the next value of a first-order bias with this stationary deviation, exact at any rate (eq. (3.12))."""
    keep = math.exp(-1.0 / (rate * correlation_time))
    return add(scale(keep, bias), scale(deviation * math.sqrt(1.0 - keep * keep), draw))


@always_inline
def limit(x: float, largest: float) -> float:
    """Clamp x to +-largest."""
    return min(max(x, -largest), largest)


@always_inline
def quantise(x: float, step: float) -> float:
    """Round x to a multiple of step; step 0: no rounding."""
    return x if step == 0.0 else step * np.floor(x / step + 0.5)


@always_inline
def digitise(v: Vec3, largest: float, step: float) -> Vec3:
    """Saturate a vector at +-largest, then quantise it, element by element."""
    return (
        quantise(limit(v[0], largest), step),
        quantise(limit(v[1], largest), step),
        quantise(limit(v[2], largest), step),
    )


@always_inline
def scale_and_misalignment(scale_error: float, misalignment: float, draw_scale: Vec3, draw_angle: Vec3) -> Mat3:
    """Return the matrix of a triad with scale errors and small misalignments (theory, eq. (3.14))."""
    a, b, c = scale(misalignment, draw_angle)
    x, y, z = scale(scale_error, draw_scale)
    return (1.0 + x, -c, b, c, 1.0 + y, -a, -b, a, 1.0 + z)
