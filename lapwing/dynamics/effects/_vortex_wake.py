"""Flow about a uniform rotor in forward flight: a skewed cylinder of vortex rings (theory, eq. (2.73)).

After Coleman, Feingold and Stempin, NACA ARR L5E10 (1945), and Castles and De Leeuw, NACA TR 1184 (1954); the integral
along the wake is taken in closed form, that around it by the trapezoidal rule.
"""

from lapwing.kernels import kernel, math

ELEMENTS = 180  # of the circumference
FLATTEST = 8.0  # greatest tangent of the wake's skew; flatter wakes are taken for this
SKEWS = tuple(k / 8.0 for k in range(9))  # speed across over the sum of those across and through the disc
OFFSETS = tuple(k / 12.0 for k in range(13))  # sine of half the angle off straight behind
RINGS, PLACES = 4, 16  # rings of equal area on a disc, and places on each, for its mean


@kernel
def normal_flow(tangent, x, y, z):
    """Return the flow along a rotor's axis at a place over that at the rotor's centre.

    Args:
        tangent: of the wake's skew, 0 straight below the disc.
        x: place in radii, downstream in the disc's plane.
        y: in radii, across the stream in the disc's plane.
        z: in radii, above the disc.
    """
    length = math.sqrt(1.0 + tangent * tangent)
    ex, ez = tangent / length, -1.0 / length  # direction of the wake
    total = 0.0
    for k in range(ELEMENTS):
        sine, cosine = math.sincos(2.0 * math.pi * (k + 0.5) / ELEMENTS)
        ax, ay = x - cosine, y - sine
        a = math.sqrt(ax * ax + ay * ay + z * z)
        along = ax * ex + z * ez
        # -z component of t x (a / |a| - e) / (|a| - a.e), t the tangent of the ring
        total -= (sine * ay / a + cosine * (ax / a - ex)) / (a - along)
    return total / ELEMENTS


@kernel
def mean_wash(skew, offset, distance):
    """Return the mean flow at a disc over that at the inducing rotor.

    Args:
        skew: speed across over the sum of those across and through the inducing disc, 0 to 1.
        offset: sine of half the angle between the disc and straight behind the inducing one, 0 to 1.
        distance: of the axes, in radii.
    """
    tangent = min(skew / max(1.0 - skew, 1e-9), FLATTEST)
    cosine = 1.0 - 2.0 * offset * offset
    x, y = distance * cosine, distance * math.sqrt(max(1.0 - cosine * cosine, 0.0))
    total = 0.0
    for i in range(RINGS):
        r = math.sqrt((i + 0.5) / RINGS)
        for k in range(PLACES):
            sine, cosine = math.sincos(2.0 * math.pi * (k + 0.25) / PLACES)
            total += normal_flow(tangent, x + r * cosine, y + r * sine, 0.0)
    return total / (RINGS * PLACES)
