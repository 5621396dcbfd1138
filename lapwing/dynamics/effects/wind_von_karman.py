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
SUM = (
    (0.80529, 0.8684), (2.7022, 0.3964), (12.508, 0.2349), (59.829, 0.1406), (286.4, 0.08334),
    (1369.4, 0.04947), (6547.4, 0.02936), (31304.0, 0.01743), (149690.0, 0.01035),
    (718040.0, 0.006156), (3768400.0, 0.0039),
)  # fmt: skip
PARTS = tuple(Part(ratio, share, (LANE + 2 * k, LANE + 2 * k + 1)) for k, (ratio, share) in enumerate(SUM))


class WindVonKarman(NamedTuple):
    """Gusts along, across and vertical to the mean wind with the von Karman spectra (theory, eq. (2.31)).

    Source: MIL-F-8785C, low-altitude model. Sum of eleven independent Dryden turbulences of falling scale. Its spectra
    are within 3 % of von Karman's up to a third of the Nyquist rate of the samples at any height and airspeed. Valid
    from 10 to 1000 feet above the ground; beyond, the values at the limits apply. Sampled exactly every 4 ms (or a
    communication step, if longer) for the height and airspeed then, linear in between.
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

    def initial_discrete_state(self) -> tuple[tuple, tuple[Vec3, Vec3], float]:
        """Return the states of the parts, the wind with its slope, and the time of the last sample."""
        return calm(self.parts)


@discrete_update(WindVonKarman)
def draw(e, memory, s, rotors, key, tick, interval):
    """Return the states of the parts, the wind [m/s, world] with its slope, and the time [s] of the last sample."""
    return drawn(e, memory, s, key, tick, interval)


@air(WindVonKarman)
def wind_von_karman(e, memory, s, before):
    """Add the turbulence to the air."""
    return add_to_air(memory, s, before)
