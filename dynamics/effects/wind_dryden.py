"""Dryden turbulence at low altitude."""

import math
import zlib
from typing import TYPE_CHECKING, Annotated, NamedTuple

from annotated_types import Ge, Gt, Le

from dynamics.effects._hooks import air, sample
from dynamics.effects._scene import checked
from dynamics.effects._types import Air
from dynamics.kernel import leaf
from dynamics.noise import normal3
from dynamics.vector import Vec3

if TYPE_CHECKING:  # a process that flies has no need of pydantic
    from dynamics.vehicles.airframe import Airframe

LANE_FIRST, LANE_SECOND = zlib.crc32(b"wind_dryden 1"), zlib.crc32(b"wind_dryden 2")
FOOT = 0.3048  # [m]
LONG_AGO = 50.0  # correlation times before the first exchange at which the filters were started


class Settings(NamedTuple):
    """What a scene says."""

    wind_speed: Annotated[float, Gt(0), Le(30)]  # [m/s] mean wind 6 m (20 feet) above the ground
    airspeed: Annotated[float, Gt(0), Le(60)]  # [m/s] at which the frozen turbulence is flown through
    altitude: Annotated[float, Ge(3.048), Le(304.8)] = 10.0  # [m] above the ground, for which scales are taken
    heading: Annotated[float, Ge(-2.0 * math.pi), Le(2.0 * math.pi)] = 0.0  # [rad] of the mean wind, 0 to the east


class WindDryden(NamedTuple):
    """Gusts along, across and vertical to the mean wind with the Dryden spectra (theory.md, eq. (2.20) to (2.24)).

    Source: MIL-F-8785C, low-altitude model (the spectra of MIL-HDBK-1797 are the same, written with halved lateral and
    vertical scales). Altitude and airspeed are those of the scene, not the vehicle's. Valid from 10 to 1000 feet.
    Sampled exactly at each exchange, held over the interval.
    """

    sigma: Vec3  # [m/s] along, across, vertical
    decay_rate: Vec3  # [1/s] airspeed over scale
    cosine: float  # of the heading
    sine: float

    @classmethod
    def from_scene(cls, table: dict, airframe: "Airframe") -> "WindDryden":
        """Intensities and scales at the given altitude."""
        given = checked(Settings, table)
        feet = given.altitude / FOOT
        base = 0.177 + 0.000823 * feet
        vertical = 0.1 * given.wind_speed
        horizontal = vertical / base**0.4
        scale_horizontal, scale_vertical = FOOT * feet / base**1.2, given.altitude
        rate = given.airspeed / scale_horizontal
        return cls(
            (horizontal, horizontal, vertical),
            (rate, rate, given.airspeed / scale_vertical),
            math.cos(given.heading),
            math.sin(given.heading),
        )

    def initial_memory(self) -> tuple[tuple[float, ...], Vec3]:
        """(along, first and second state across, first and second vertical, 1 once started), then the wind."""
        return (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)


@leaf
def _second_order(x1, x2, theta, n1, n2):
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


@leaf
def _output(x1, x2):
    """Of the transverse filter, with unit variance."""
    return math.sqrt(3.0) * x1 + (1.0 - math.sqrt(3.0)) * x2


@sample(WindDryden)
def draw(e, memory, s, rotors, key, tick, interval):
    """States of the filters and the wind [m/s, world] for the next interval."""
    along, across1, across2, up1, up2, started = memory[0]
    time = interval if started > 0.0 else LONG_AGO / min(min(e.decay_rate[0], e.decay_rate[1]), e.decay_rate[2])
    first, second = normal3(key, tick, LANE_FIRST), normal3(key, tick, LANE_SECOND)
    kept = math.exp(-e.decay_rate[0] * time)
    along = kept * along + math.sqrt(1.0 - kept * kept) * first[0]
    across1, across2 = _second_order(across1, across2, e.decay_rate[1] * time, first[1], second[0])
    up1, up2 = _second_order(up1, up2, e.decay_rate[2] * time, first[2], second[1])
    u, v, w = e.sigma[0] * along, e.sigma[1] * _output(across1, across2), e.sigma[2] * _output(up1, up2)
    wind = (e.cosine * u - e.sine * v, e.sine * u + e.cosine * v, w)
    return (along, across1, across2, up1, up2, 1.0), wind


@air(WindDryden)
def wind_dryden(e, memory, s, before):
    """Air with the turbulence added."""
    wind, gust = before.wind_world, memory[1]
    return Air(before.density, (wind[0] + gust[0], wind[1] + gust[1], wind[2] + gust[2]))
