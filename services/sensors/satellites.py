"""Satellites in view of a receiver: fixed directions, or a constellation on its orbits (theory, section 3.2)."""

from typing import Annotated, Any, NamedTuple

from annotated_types import Ge, Gt, Le, Lt

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.geodesy import SEMI_MAJOR, Home, geodetic_to_ecef
from lapwing.dynamics.noise import Key, normal3
from lapwing.dynamics.vector import IDENTITY, ZERO, Mat3, Vec3
from lapwing.kernels import kernel, math, python_function
from lapwing.services.sensors import error_models
from lapwing.services.sensors.multipath import Reflections, code_error, in_shadow, phase_error

FEWEST = 4  # satellites of a fix
WORST = 50.0  # dilution of precision of a fix
FLATTEST = 1e-9  # minimum determinant of the directions' spread for a position
NO_POSITION: Mat3 = (math.nan,) * 9  # type: ignore[assignment]
MOST = 24  # satellites of a constellation
GRAVITATION = 3.986004418e14  # [m^3/s^2] of the Earth, WGS 84
EARTH_RATE = 7.292115e-5  # [rad/s] WGS 84
_RANGE_LANE, _NOISE_LANE = 16, 32  # lanes of the range errors' random numbers, above the receiver's

RangeErrors = tuple[Vec3, Vec3, Vec3, Vec3, Vec3, Vec3, Vec3, Vec3]  # of MOST satellites, in standard deviations
NO_ERRORS: RangeErrors = (ZERO,) * 8  # type: ignore[assignment]


class Satellite(NamedTuple):
    """Direction of a satellite as seen from home."""

    azimuth_deg: Annotated[float, Ge(-360), Le(360)]  # [deg] from north towards east
    elevation_deg: Annotated[float, Ge(0), Le(90)]  # [deg] over the horizon


class Constellation(NamedTuple):
    """Walker delta pattern on circular orbits; the defaults are Galileo's, 56 deg: 24/3/1 at 23222 km."""

    satellites: Annotated[int, Ge(FEWEST), Le(MOST)] = 24  # of all planes
    planes: Annotated[int, Ge(1), Le(MOST)] = 3  # equally spaced about the Earth's axis
    phasing: Annotated[int, Ge(0), Lt(MOST)] = 1  # of neighbouring planes, in units of 360 deg by `satellites`
    inclination_deg: Annotated[float, Ge(0), Le(180)] = 56.0  # [deg] of the orbits
    altitude: Annotated[float, Gt(0), Le(1e8)] = 23_222e3  # [m] over the equator
    time: Annotated[float, Ge(-1e6), Le(1e6)] = 0.0  # [s] since a satellite passed over the equator at longitude 0
    mask_deg: Annotated[float, Ge(0), Lt(90)] = 10.0  # [deg] elevation below which a satellite is not used
    reflections: Reflections | None = None  # multipath at the walls of the terrain's boxes; default: none
    steepness: float = 0.0  # compiled from the scene's terrain


class Solution(NamedTuple):
    """Fix from the satellites in view."""

    error: Vec3 = ZERO  # [m] east, north, up
    variance: Vec3 = ZERO  # east, north, up, by distances of unit deviation
    used: int = 0  # satellites
    visible: int = 0  # satellites above the mask, including shadowed ones
    has_fix: bool = False


@kernel
def geometry(sky: tuple[Satellite, ...] | None) -> Mat3:
    """Return the factor L of `GpsState`; NaN if the satellites do not determine a position (theory, eq. (3.42))."""
    if sky is None:
        return IDENTITY
    x = y = z = xx = xy = xz = yy = yz = zz = 0.0
    for satellite in sky:
        azimuth, elevation = math.radians(satellite.azimuth_deg), math.radians(satellite.elevation_deg)
        e, n = math.cos(elevation) * math.sin(azimuth), math.cos(elevation) * math.cos(azimuth)
        u = math.sin(elevation)
        x, y, z = x + e, y + n, z + u
        xx, xy, xz, yy, yz, zz = xx + e * e, xy + e * n, xz + e * u, yy + n * n, yz + n * u, zz + u * u
    # the common part of all distances is the receiver's clock error
    k = 1.0 / len(sky)
    xx, xy, xz = xx - k * x * x, xy - k * x * y, xz - k * x * z
    yy, yz, zz = yy - k * y * y, yz - k * y * z, zz - k * z * z
    a, b, c = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    determinant = xx * a + xy * b + xz * c
    if determinant < FLATTEST:
        return NO_POSITION
    over = 1.0 / determinant
    l11 = math.sqrt(a * over)
    l21, l31 = b * over / l11, c * over / l11
    l22 = math.sqrt((xx * zz - xz * xz) * over - l21 * l21)
    l32 = ((xy * xz - xx * yz) * over - l31 * l21) / l22
    return (l11, 0.0, 0.0, l21, l22, 0.0, l31, l32, math.sqrt((xx * yy - xy * xy) * over - l31 * l31 - l32 * l32))


def check_sky(sky: tuple[Satellite, ...] | None) -> None:
    """Raise ConfigError if the satellites do not determine a position."""
    if sky is None:
        return
    dilution = math.sqrt(math.total(x * x for x in python_function(geometry)(sky))) if len(sky) >= FEWEST else math.inf
    if not dilution < WORST:
        problem = f"got {len(sky)} satellites with a dilution of precision (PDOP) of {dilution:.3g}"
        raise ConfigError("sky", problem, f"{FEWEST} or more, spread so that it is below {WORST:g}")


def check_constellation(c: Constellation | None) -> None:
    """Raise ConfigError if the satellites cannot be distributed over the planes."""
    if c is not None and c.satellites % c.planes:
        raise ConfigError("constellation.planes", f"got {c.planes}", f"a divisor of satellites = {c.satellites}")


@kernel
def direction(c: Constellation, home: Home, k: int, time: float) -> Vec3:
    """Return the unit vector, east, north, up, from home to satellite k at a time [s] (theory, eq. (3.55))."""
    each = c.satellites // c.planes
    plane, slot = k // each, k % each
    radius = SEMI_MAJOR + c.altitude
    motion = math.sqrt(GRAVITATION / radius) / radius * time
    along = 2.0 * math.pi * (slot / each + c.phasing * plane / c.satellites) + motion
    sa, ca = math.sincos(along)
    sn, cn = math.sincos(2.0 * math.pi * plane / c.planes - EARTH_RATE * time)
    si, ci = math.sincos(math.radians(c.inclination_deg))
    o = geodetic_to_ecef(home.latitude_deg, home.longitude_deg, home.height)
    x = radius * (cn * ca - sn * sa * ci) - o[0]
    y = radius * (sn * ca + cn * sa * ci) - o[1]
    z = radius * sa * si - o[2]
    sp, cp = math.sincos(math.radians(home.latitude_deg))
    sl, cl = math.sincos(math.radians(home.longitude_deg))
    outward, over = cl * x + sl * y, 1.0 / math.sqrt(x * x + y * y + z * z)
    return (cl * y - sl * x) * over, (cp * z - sp * outward) * over, (cp * outward + sp * z) * over


@kernel
def first_errors(c: Constellation | None, key: Key, tick: int) -> RangeErrors:
    """Return the correlated errors of the distances at the start."""
    if c is None:
        return NO_ERRORS
    return (
        normal3(key, tick, _RANGE_LANE), normal3(key, tick, _RANGE_LANE + 1), normal3(key, tick, _RANGE_LANE + 2),
        normal3(key, tick, _RANGE_LANE + 3), normal3(key, tick, _RANGE_LANE + 4), normal3(key, tick, _RANGE_LANE + 5),
        normal3(key, tick, _RANGE_LANE + 6), normal3(key, tick, _RANGE_LANE + 7),
    )  # fmt: skip


@kernel
def next_errors(
    c: Constellation | None, s: RangeErrors, correlation_time: float, rate: float, key: Key, tick: int
) -> RangeErrors:
    """Return the correlated errors of the distances one sample later."""
    if c is None:
        return s
    d, t = first_errors(c, key, tick), correlation_time
    return (
        error_models.walk(s[0], 1.0, t, rate, d[0]), error_models.walk(s[1], 1.0, t, rate, d[1]),
        error_models.walk(s[2], 1.0, t, rate, d[2]), error_models.walk(s[3], 1.0, t, rate, d[3]),
        error_models.walk(s[4], 1.0, t, rate, d[4]), error_models.walk(s[5], 1.0, t, rate, d[5]),
        error_models.walk(s[6], 1.0, t, rate, d[6]), error_models.walk(s[7], 1.0, t, rate, d[7]),
    )  # fmt: skip


@kernel
def _multipath(r: Reflections | None, terrain: Any, position: Vec3, towards: Vec3, carrier: bool) -> float:
    if r is None:
        return 0.0
    return phase_error(r, terrain, position, towards) if carrier else code_error(r, terrain, position, towards)


@kernel
def solution(
    c: Constellation | None, home: Home, terrain: Any, position: Vec3, time: float, errors: RangeErrors,
    correlated: float, white: float, carrier: bool, key: Key, tick: int,
) -> Solution:  # fmt: skip
    """Return the fix by least squares over the satellites in view (theory, eq. (3.56)).

    Args:
        c: constellation; None: satellites are not modelled.
        home: origin of the world frame.
        terrain: Level or Relief.
        position: [m] of the antenna, world.
        time: [s] of the simulation.
        errors: correlated errors of the distances, in standard deviations.
        correlated: [m] standard deviation of `errors`.
        white: [m] standard deviation of the white noise of a distance.
        carrier: True if the fix is by carrier phases, whose multipath is below a quarter of a wavelength.
        key: key of the receiver.
        tick: present tick.
    """
    if c is None:
        return Solution(ZERO, ZERO, 0, 0, True)
    x = y = z = xx = xy = xz = yy = yz = zz = 0.0
    total = bx = by = bz = 0.0
    used, visible, lowest = 0, 0, math.sin(math.radians(c.mask_deg))
    noises = ZERO
    for k in range(c.satellites):
        if k % 3 == 0:
            noises = normal3(key, tick, _NOISE_LANE + k // 3)
        e, n, u = direction(c, home, k, c.time + time)
        if u < lowest:
            continue
        visible += 1
        if in_shadow(terrain, position, (e, n, u), c.steepness):
            continue
        used += 1
        range_error = correlated * errors[k // 3][k % 3] + white * noises[k % 3]
        range_error += _multipath(c.reflections, terrain, position, (e, n, u), carrier)
        x, y, z, total = x + e, y + n, z + u, total + range_error
        xx, xy, xz, yy, yz, zz = xx + e * e, xy + e * n, xz + e * u, yy + n * n, yz + n * u, zz + u * u
        bx, by, bz = bx + e * range_error, by + n * range_error, bz + u * range_error
    if used < FEWEST:
        return Solution(ZERO, ZERO, used, visible, False)
    k1 = 1.0 / used
    xx, xy, xz = xx - k1 * x * x, xy - k1 * x * y, xz - k1 * x * z
    yy, yz, zz = yy - k1 * y * y, yz - k1 * y * z, zz - k1 * z * z
    bx, by, bz = bx - k1 * x * total, by - k1 * y * total, bz - k1 * z * total
    a, b, g = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    d, f, h = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    determinant = xx * a + xy * b + xz * g
    if determinant < FLATTEST:
        return Solution(ZERO, ZERO, used, visible, False)
    over = 1.0 / determinant
    variance = (a * over, d * over, h * over)
    # a distance measured too long moves the fix away from its satellite
    error = (
        -over * (a * bx + b * by + g * bz), -over * (b * bx + d * by + f * bz), -over * (g * bx + f * by + h * bz),
    )  # fmt: skip
    return Solution(error, variance, used, visible, variance[0] + variance[1] + variance[2] < WORST * WORST)
