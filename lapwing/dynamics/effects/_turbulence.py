"""What turbulence near the ground has in common: how strong, how large and how fast it passes (MIL-F-8785C)."""

from typing import Annotated, Any, NamedTuple

from annotated_types import Ge, Gt, Le

from lapwing.dynamics.effects._from_scene import checked
from lapwing.dynamics.terrain import LEVEL, surface
from lapwing.dynamics.vector import Vec3, norm, subtract
from lapwing.kernels import always_inline, math

KIND = "turbulence"
FOOT = 0.3048  # [m]
LOWEST, HIGHEST = 10.0 * FOOT, 1000.0 * FOOT  # [m] within which the model is stated
SLOWEST = 0.1  # [m/s] a vehicle that goes with the wind is not passed by it at all
LONG_AGO = 50.0  # correlation times before the first exchange at which the filters were started


class Settings(NamedTuple):
    """What a scene says."""

    wind_speed: Annotated[float, Gt(0), Le(30)]  # [m/s] mean wind 6 m (20 feet) above the ground
    airspeed: Annotated[float, Gt(0), Le(60)] | None = None  # [m/s] at which gusts pass; if left out, the vehicle's
    altitude: Annotated[float, Ge(3.048), Le(304.8)] | None = None  # [m] above the ground; if left out, the vehicle's
    direction_to: Annotated[float, Ge(-2.0 * math.pi), Le(2.0 * math.pi)] = 0.0  # [rad] of the mean wind, 0 to the east


class Conditions(NamedTuple):
    """What scales and intensities follow from."""

    wind_speed: float  # [m/s]
    airspeed: float  # [m/s], 0 for the vehicle's
    altitude: float  # [m] above the ground, 0 for the vehicle's
    cosine: float  # of the heading
    sine: float
    terrain: Any = LEVEL  # Level or Relief


def conditions(table: dict) -> Conditions:
    """From a scene's table. Raises KeyedError."""
    given = checked(Settings, table)
    airspeed, altitude = given.airspeed or 0.0, given.altitude or 0.0
    return Conditions(given.wind_speed, airspeed, altitude, math.cos(given.direction_to), math.sin(given.direction_to))


@always_inline
def intensity(wind_speed, altitude):
    """(standard deviations [m/s], scales [m]) along, across and vertical to the wind (theory.md, eq. (2.20))."""
    feet = altitude / FOOT
    base = 0.177 + 0.000823 * feet
    vertical = 0.1 * wind_speed
    horizontal, scale = vertical / math.pow(base, 0.4), FOOT * feet / math.pow(base, 1.2)
    return (horizontal, horizontal, vertical), (scale, scale, altitude)


@always_inline
def surroundings(c: Conditions, s: Any) -> tuple[float, float]:
    """(altitude over the ground [m], airspeed [m/s]) of a vehicle in a situation."""
    x, y, z = s.motion.position_world
    altitude, airspeed = c.altitude, c.airspeed
    if altitude == 0.0:
        altitude = min(max(z - surface(c.terrain, x, y)[0], LOWEST), HIGHEST)
    if airspeed == 0.0:
        airspeed = max(norm(subtract(s.motion.velocity_world, s.air.wind_world)), SLOWEST)
    return altitude, airspeed


@always_inline
def passing(c: Conditions, s: Any) -> tuple[Vec3, Vec3]:
    """(standard deviations [m/s], airspeed over scale [1/s]) for a vehicle in a situation."""
    altitude, airspeed = surroundings(c, s)
    sigma, scale = intensity(c.wind_speed, altitude)
    return sigma, (airspeed / scale[0], airspeed / scale[1], airspeed / scale[2])


@always_inline
def in_world(c: Conditions, u: float, v: float, w: float) -> Vec3:
    """Gusts along, across and vertical to the wind in world coordinates."""
    return (c.cosine * u - c.sine * v, c.sine * u + c.cosine * v, w)


@always_inline
def first_order(x, theta, n):
    """State of the longitudinal filter `theta` correlation times later (theory.md, eq. (2.22))."""
    kept = math.exp(-theta)
    return kept * x + math.sqrt(1.0 - kept * kept) * n


@always_inline
def second_order(x1, x2, theta, n1, n2):
    """The states of the transverse filter `theta` correlation times later (theory.md, eq. (2.23))."""
    kept = math.exp(-theta)
    square = kept * kept
    q11 = 0.5 * (1.0 - square)
    q12 = 0.25 * (1.0 - square * (1.0 + 2.0 * theta))
    q22 = 0.25 * (1.0 - square * (1.0 + 2.0 * theta * (1.0 + theta)))
    root = math.sqrt(q11)
    cross = q12 / root
    rest = math.sqrt(max(q22 - cross * cross, 0.0))
    return kept * x1 + root * n1, kept * (x2 + theta * x1) + cross * n1 + rest * n2


@always_inline
def transverse(x1, x2):
    """Output of the transverse filter, with unit variance (theory.md, eq. (2.24))."""
    return math.sqrt(3.0) * x1 + (1.0 - math.sqrt(3.0)) * x2
