"""Dryden turbulence at low altitude."""

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
from lapwing.dynamics.vector import ZERO, Vec3, add

if TYPE_CHECKING:  # a process that flies has no need of pydantic
    from lapwing.dynamics.vehicles.airframe import Airframe

__all__ = ["KIND", "Settings", "WindDryden"]

LANE_FIRST, LANE_SECOND = zlib.crc32(b"wind_dryden 1"), zlib.crc32(b"wind_dryden 2")


class WindDryden(NamedTuple):
    """Gusts along, across and vertical to the mean wind with the Dryden spectra (theory.md, eq. (2.20) to (2.24)).

    Source: MIL-F-8785C, low-altitude model (the spectra of MIL-HDBK-1797 are the same, written with halved lateral and
    vertical scales). Valid from 10 to 1000 feet above the ground; below and above it is as there. Sampled exactly at
    each exchange for the height and the airspeed there, held over the interval.
    """

    conditions: Conditions

    @classmethod
    def from_scene(cls, table: dict, airframe: "Airframe") -> "WindDryden":
        """Over level ground."""
        return cls(conditions(table))

    def in_environment(self, environment: Environment) -> "WindDryden":
        """Over the ground that is there."""
        return WindDryden(self.conditions._replace(terrain=environment.terrain))

    def initial_discrete_state(self) -> tuple[tuple[float, ...], Vec3]:
        """(along, first and second state across, first and second vertical, 1 once started), then the wind."""
        return (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), ZERO


@discrete_update(WindDryden)
def draw(e, memory, s, rotors, key, tick, interval):
    """States of the filters and the wind [m/s, world] for the next interval."""
    along, across1, across2, up1, up2, started = memory[0]
    sigma, rate = passing(e.conditions, s)
    time = interval if started > 0.0 else LONG_AGO / min(min(rate[0], rate[1]), rate[2])
    first, second = normal3(key, tick, LANE_FIRST), normal3(key, tick, LANE_SECOND)
    along = first_order(along, rate[0] * time, first[0])
    across1, across2 = second_order(across1, across2, rate[1] * time, first[1], second[0])
    up1, up2 = second_order(up1, up2, rate[2] * time, first[2], second[1])
    u, v, w = sigma[0] * along, sigma[1] * transverse(across1, across2), sigma[2] * transverse(up1, up2)
    return (along, across1, across2, up1, up2, 1.0), in_world(e.conditions, u, v, w)


@air(WindDryden)
def wind_dryden(e, memory, s, before):
    """Air with the turbulence added."""
    return Air(before.density, add(before.wind_world, memory[1]))
