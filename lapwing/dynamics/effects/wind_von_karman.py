"""Von Karman turbulence at low altitude."""

import zlib
from typing import NamedTuple

from lapwing.dynamics.effects._from_scene import Airframe
from lapwing.dynamics.effects._hooks import air, discrete_update
from lapwing.dynamics.effects._turbulence import KIND, Conditions, Part, Settings, add_to_air, calm, conditions, drawn
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.vector import Vec3

__all__ = ["KIND", "PARTS", "Settings", "WindVonKarman"]

LANE = zlib.crc32(b"wind_von_karman")
# scale of the whole over that of the part, its share of the deviation
SUM = ((0.8376, 0.8943), (4.1686, 0.3785), (26.987, 0.2021), (182.72, 0.1120))
PARTS = tuple(Part(ratio, share, (LANE + 2 * k, LANE + 2 * k + 1)) for k, (ratio, share) in enumerate(SUM))


class WindVonKarman(NamedTuple):
    """Gusts along, across and vertical to the mean wind with the von Karman spectra (theory, eq. (2.31)).

    Source: MIL-F-8785C, low-altitude model. A sum of four independent Dryden turbulences of falling scale, whose
    spectra are within 2.1 % of von Karman's up to 300 times the corner frequency. Valid from 10 to 1000 feet above the
    ground; beyond, the values at the limits apply. Sampled exactly once per communication step for the current height
    and airspeed, and held.
    """

    conditions: Conditions
    parts: tuple[Part, ...] = PARTS

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "WindVonKarman":
        """Return the parameters over level ground."""
        return cls(conditions(table))

    def in_environment(self, environment: Environment) -> "WindVonKarman":
        """Return the effect over the scene's terrain."""
        return WindVonKarman(self.conditions._replace(terrain=environment.terrain))

    def initial_discrete_state(self) -> tuple[tuple, Vec3, float]:
        """Return the states of the parts, the wind, and 1 once started."""
        return calm(self.parts)


@discrete_update(WindVonKarman)
def draw(e, memory, s, rotors, key, tick, interval):
    """Return the states of the parts, the wind [m/s, world] for the next interval, and 1: started."""
    return drawn(e, memory, s, key, tick, interval)


@air(WindVonKarman)
def wind_von_karman(e, memory, s, before):
    """Add the turbulence to the air."""
    return add_to_air(memory, before)
