"""Von Karman turbulence at low altitude."""

import zlib
from typing import TYPE_CHECKING, NamedTuple

from lapwing.dynamics.effects._hooks import air, discrete_update
from lapwing.dynamics.effects._turbulence import (
    KIND,
    LONG_AGO,
    Conditions,
    Settings,
    conditions,
    first_order,
    in_world,
    passing,
    second_order,
    transverse,
)
from lapwing.dynamics.effects._types import Air
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.noise import normal3
from lapwing.dynamics.vector import ZERO, Vec3, add, multiply
from lapwing.kernels import kernel

if TYPE_CHECKING:  # a process that flies has no need of pydantic
    from lapwing.dynamics.vehicles.airframe import Airframe

__all__ = ["KIND", "PARTS", "Settings", "WindVonKarman"]

LANE = zlib.crc32(b"wind_von_karman")
# Dryden turbulences of which it is the sum: (scale of the whole over that of the part, its share of the deviation)
PARTS = ((0.8376, 0.8943), (4.1686, 0.3785), (26.987, 0.2021), (182.72, 0.1120))
Part = tuple[float, float, float, float, float]


class WindVonKarman(NamedTuple):
    """Gusts along, across and vertical to the mean wind with the von Karman spectra (theory.md, eq. (2.31)).

    Source: MIL-F-8785C, low-altitude model. A sum of four independent Dryden turbulences of falling scale, whose
    spectra are within 2.1 % of von Karman's up to 300 times the corner frequency. Valid from 10 to 1000 feet above the
    ground; below and above it is as there. Sampled exactly at each exchange for the height and the airspeed there, held
    over the interval.
    """

    conditions: Conditions

    @classmethod
    def from_scene(cls, table: dict, airframe: "Airframe") -> "WindVonKarman":
        """Over level ground."""
        return cls(conditions(table))

    def in_environment(self, environment: Environment) -> "WindVonKarman":
        """Over the ground that is there."""
        return WindVonKarman(self.conditions._replace(terrain=environment.terrain))

    def initial_discrete_state(self) -> tuple[tuple[Part, Part, Part, Part], Vec3, float]:
        """(along, first and second state across, the same vertical) of each part, the wind, and 1 once started."""
        nothing = (0.0, 0.0, 0.0, 0.0, 0.0)
        return (nothing, nothing, nothing, nothing), ZERO, 0.0


@kernel
def _part(k, state, theta, key, tick):
    """State of a part after `theta` correlation times of the whole, and its gust for unit deviations."""
    ratio, share = PARTS[k]
    along, across1, across2, up1, up2 = state
    first, second = normal3(key, tick, LANE + 2 * k), normal3(key, tick, LANE + 2 * k + 1)
    along = first_order(along, ratio * theta[0], first[0])
    across1, across2 = second_order(across1, across2, ratio * theta[1], first[1], second[0])
    up1, up2 = second_order(up1, up2, ratio * theta[2], first[2], second[1])
    gust = (share * along, share * transverse(across1, across2), share * transverse(up1, up2))
    return (along, across1, across2, up1, up2), gust


@discrete_update(WindVonKarman)
def draw(e, memory, s, rotors, key, tick, interval):
    """States of the parts, the wind [m/s, world] for the next interval, and that it has started."""
    sigma, rate = passing(e.conditions, s)
    time = interval if memory[2] > 0.0 else LONG_AGO / min(min(rate[0], rate[1]), rate[2])
    theta = (rate[0] * time, rate[1] * time, rate[2] * time)
    a, gust_a = _part(0, memory[0][0], theta, key, tick)
    b, gust_b = _part(1, memory[0][1], theta, key, tick)
    c, gust_c = _part(2, memory[0][2], theta, key, tick)
    d, gust_d = _part(3, memory[0][3], theta, key, tick)
    u, v, w = multiply(sigma, add(add(gust_a, gust_b), add(gust_c, gust_d)))
    return (a, b, c, d), in_world(e.conditions, u, v, w), 1.0


@air(WindVonKarman)
def wind_von_karman(e, memory, s, before):
    """Air with the turbulence added."""
    return Air(before.density, add(before.wind_world, memory[1]))
