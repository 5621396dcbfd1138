"""Low-altitude turbulence: intensities, scales and convection speed (MIL-F-8785C), and its samples as a sum of parts.

A process with its own rate: samples are `SAMPLE_TIME` apart, or a communication step if that is longer, with exact
covariances, and the air changes linearly between them. So flights at communication rates of 250 Hz and its doubles have
the same turbulence. Up to a third of the Nyquist rate of the samples its spectrum is within 3 % of von Karman's, and
that of Dryden multiplied by sinc^2 of frequency over sampling rate (theory, section 2.5).
"""

from typing import Annotated, Any, NamedTuple

from annotated_types import Ge, Gt, Le

from lapwing.dynamics.effects._from_scene import validate_table
from lapwing.dynamics.effects._rotor_sums import total
from lapwing.dynamics.effects._types import Air
from lapwing.dynamics.noise import normal3
from lapwing.dynamics.terrain import LEVEL, surface
from lapwing.dynamics.vector import ZERO, Vec3, add, first, multiply, norm, scale, subtract
from lapwing.kernels import always_inline, math, noinline
from lapwing.kernels.codegen import map_tuple

KIND = "turbulence"
FOOT = 0.3048  # [m]
LOWEST, HIGHEST = 10.0 * FOOT, 1000.0 * FOOT  # [m] range of altitudes of the model
SLOWEST = 0.1  # [m/s] lower limit: gusts do not pass a vehicle that moves with the wind
LONG_AGO = 50.0  # correlation times from the start of the filters to the first sample
SAMPLE_TIME = 0.004  # [s] largest time between samples that are further apart than a communication step
ROUNDING = 1e-9  # relative to that time
NOT_STARTED = -1.0  # [s] time of the last sample, before the first


class Settings(NamedTuple):
    """Scene table."""

    wind_speed: Annotated[float, Gt(0), Le(30)]  # [m/s] mean wind 6 m (20 feet) above the ground
    airspeed: Annotated[float, Gt(0), Le(60)] | None = None  # [m/s] at which gusts pass; if left out, the vehicle's
    altitude: Annotated[float, Ge(3.048), Le(304.8)] | None = None  # [m] above the ground; if left out, the vehicle's
    direction_to: Annotated[float, Ge(-2.0 * math.pi), Le(2.0 * math.pi)] = 0.0  # [rad] of the mean wind, 0 to the east


class Conditions(NamedTuple):
    """Conditions that determine scales and intensities."""

    wind_speed: float  # [m/s]
    airspeed: float  # [m/s], 0 for the vehicle's
    altitude: float  # [m] above the ground, 0 for the vehicle's
    cosine: float  # of the heading
    sine: float
    terrain: Any = LEVEL  # Level or Relief


class Part(NamedTuple):
    """One of the Dryden turbulences whose sum is a turbulence."""

    ratio: float  # scale of the whole over that of the part
    share: float  # of the deviation
    lanes: tuple[int, int]  # of its random numbers


def conditions(table: dict) -> Conditions:
    """Return the conditions of a scene's table. Raise ConfigError if it is invalid."""
    settings = validate_table(Settings, table)
    airspeed, altitude = settings.airspeed or 0.0, settings.altitude or 0.0
    return Conditions(
        settings.wind_speed, airspeed, altitude, math.cos(settings.direction_to), math.sin(settings.direction_to)
    )


@always_inline
def intensity(wind_speed, altitude):
    """Return (standard deviations [m/s], scales [m]) along, across and vertical to the wind (theory, eq. (2.20))."""
    feet = altitude / FOOT
    base = 0.177 + 0.000823 * feet
    vertical = 0.1 * wind_speed
    horizontal, scale = vertical / math.pow(base, 0.4), FOOT * feet / math.pow(base, 1.2)
    return (horizontal, horizontal, vertical), (scale, scale, altitude)


@always_inline
def surroundings(c: Conditions, s: Any) -> tuple[float, float]:
    """Return (altitude over the ground [m], airspeed [m/s]) of a vehicle in a situation."""
    x, y, z = s.motion.position_world
    altitude, airspeed = c.altitude, c.airspeed
    if altitude == 0.0:
        altitude = min(max(z - surface(c.terrain, x, y)[0], LOWEST), HIGHEST)
    if airspeed == 0.0:
        airspeed = max(norm(subtract(s.motion.velocity_world, s.air.wind_world)), SLOWEST)
    return altitude, airspeed


@always_inline
def deviation_and_rate(c: Conditions, s: Any) -> tuple[Vec3, Vec3]:
    """Return (standard deviations [m/s], airspeed over scale [1/s]) for a vehicle in a situation."""
    altitude, airspeed = surroundings(c, s)
    sigma, scale = intensity(c.wind_speed, altitude)
    return sigma, (airspeed / scale[0], airspeed / scale[1], airspeed / scale[2])


@always_inline
def in_world(c: Conditions, u: float, v: float, w: float) -> Vec3:
    """Return gusts along, across and vertical to the wind in world coordinates."""
    return (c.cosine * u - c.sine * v, c.sine * u + c.cosine * v, w)


@always_inline
def first_order(x, theta, n):
    """Return the state of the longitudinal filter `theta` correlation times later (theory, eq. (2.22))."""
    decay = math.exp(-theta)
    return decay * x + math.sqrt(1.0 - decay * decay) * n


@always_inline
def second_order(x1, x2, theta, n1, n2):
    """Return the states of the transverse filter `theta` correlation times later (theory, eq. (2.23))."""
    decay = math.exp(-theta)
    square = decay * decay
    q11 = 0.5 * (1.0 - square)
    q12 = 0.25 * (1.0 - square * (1.0 + 2.0 * theta))
    q22 = 0.25 * (1.0 - square * (1.0 + 2.0 * theta * (1.0 + theta)))
    root = math.sqrt(q11)
    cross = q12 / root
    rest = math.sqrt(max(q22 - cross * cross, 0.0))
    return decay * x1 + root * n1, decay * (x2 + theta * x1) + cross * n1 + rest * n2


@always_inline
def ticks_per_sample(interval):
    """Return the number of communication steps of `interval` [s] between samples: a power of two, at least 1."""
    number = 1
    while 2 * number * interval <= SAMPLE_TIME * (1.0 + ROUNDING):
        number *= 2
    return number


@always_inline
def time_to_sample(started, rate, period):
    """Return the time [s] that a sample advances the filters: long before the first, at these rates [1/s] of them."""
    return period if started else LONG_AGO / min(min(rate[0], rate[1]), rate[2])


@always_inline
def next_line(line, last, now, started, sample, period):
    """Return (value at `now` [s], slope [1/s]) that reaches a sample after `period` [s]; constant before the first.

    Args:
        line: (value, slope) since the last sample.
        last: time [s] of that sample.
        now: present time [s].
        started: False before the first sample.
        sample: value at the end of the period.
        period: time [s] to the next sample.
    """
    if not started:
        return sample, ZERO
    value = on_line(line, now - last)
    return value, scale(1.0 / period, subtract(sample, value))


@always_inline
def on_line(line, time):
    """Return the value `time` [s] after the last sample."""
    return add(line[0], scale(time, line[1]))


@always_inline
def advance_filters(states, theta, first, second):
    """Return the filter states `theta` correlation times (along, across, vertical) later, and gusts of unit deviation.

    Args:
        states: along, first and second state across, first and second vertical.
        theta: times over the correlation times of the three filters.
        first: normal draws of the three first states.
        second: normal draws of the two second states.
    """
    along, across1, across2, up1, up2 = states
    along = first_order(along, theta[0], first[0])
    across1, across2 = second_order(across1, across2, theta[1], first[1], second[0])
    up1, up2 = second_order(up1, up2, theta[2], first[2], second[1])
    return (along, across1, across2, up1, up2), (along, transverse(across1, across2), transverse(up1, up2))


@always_inline
def transverse(x1, x2):
    """Return the output of the transverse filter, with unit variance (theory, eq. (2.24))."""
    return math.sqrt(3.0) * x1 + (1.0 - math.sqrt(3.0)) * x2


def calm(parts: tuple[Part, ...]) -> tuple[tuple, tuple[Vec3, Vec3], float]:
    """Return (along, two states across, two vertical) of each part, (wind [m/s], slope), time [s] of the sample."""
    return ((0.0, 0.0, 0.0, 0.0, 0.0),) * len(parts), (ZERO, ZERO), NOT_STARTED


@noinline
def _advance_part(c, part, state):
    """Return (states, gust for unit deviations) of a part, `theta` correlation times of the whole later."""
    theta, key, number = c
    first, second = normal3(key, number, part.lanes[0]), normal3(key, number, part.lanes[1])
    states, gust = advance_filters(state, scale(part.ratio, theta), first, second)
    return states, scale(part.share, gust)


@always_inline
def _gust(axis, part, _):
    return part[1][axis]


@always_inline
def drawn(e, memory, s, key, tick, interval):
    """Return the states of the parts, the wind [m/s, world] and its slope to the next sample, and the time [s]."""
    every = ticks_per_sample(interval)
    started = memory[2] >= 0.0
    if started and tick % every != 0:
        return memory
    period, now = every * interval, tick * interval
    sigma, rate = deviation_and_rate(e.conditions, s)
    theta = scale(time_to_sample(started, rate, period), rate)
    parts = map_tuple(_advance_part, (theta, key, tick // every), e.parts, memory[0])
    gust = (
        total(map_tuple(_gust, 0, parts, parts)),
        total(map_tuple(_gust, 1, parts, parts)),
        total(map_tuple(_gust, 2, parts, parts)),
    )
    u, v, w = multiply(sigma, gust)
    line = next_line(memory[1], memory[2], now, started, in_world(e.conditions, u, v, w), period)
    return map_tuple(first, 0, parts, parts), line, now


@always_inline
def add_to_air(memory, s, before):
    """Add the turbulence to the air."""
    return Air(before.density, add(before.wind_world, on_line(memory[1], s.t - memory[2])))
