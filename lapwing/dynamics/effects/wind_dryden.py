"""Dryden turbulence at low altitude."""

import zlib
from typing import NamedTuple

from lapwing.dynamics.effects._from_scene import Airframe
from lapwing.dynamics.effects._hooks import air, discrete_update
from lapwing.dynamics.effects._turbulence import KIND, Conditions, Part, Settings, add_to_air, calm, conditions, drawn
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.vector import Vec3

__all__ = ["KIND", "Settings", "WindDryden"]

LANES = zlib.crc32(b"wind_dryden 1"), zlib.crc32(b"wind_dryden 2")
PARTS = (Part(1.0, 1.0, LANES),)


class WindDryden(NamedTuple):
    """Gusts along, across and vertical to the mean wind with the Dryden spectra (theory, eq. (2.20) to (2.24)).

    Source: MIL-F-8785C, low-altitude model (the spectra of MIL-HDBK-1797 are the same, written with halved lateral and
    vertical scales). Valid from 10 to 1000 feet above the ground; beyond, the values at the limits apply. Sampled
    exactly every 4 ms (or a communication step, if longer) for the height and airspeed then, linear in between.
    """

    conditions: Conditions
    parts: tuple[Part, ...] = PARTS

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "WindDryden":
        """Return the parameters over level ground."""
        return cls(conditions(table))

    def in_environment(self, environment: Environment) -> "WindDryden":
        """Return the effect over the scene's terrain."""
        return WindDryden(self.conditions._replace(terrain=environment.terrain))

    def initial_discrete_state(self) -> tuple[tuple, tuple[Vec3, Vec3], float]:
        """Return the states of the parts, the wind with its slope, and the time of the last sample."""
        return calm(self.parts)


@discrete_update(WindDryden)
def draw(e, memory, s, rotors, key, tick, interval):
    """Return the states of the parts, the wind [m/s, world] with its slope, and the time [s] of the last sample."""
    return drawn(e, memory, s, key, tick, interval)


@air(WindDryden)
def wind_dryden(e, memory, s, before):
    """Add the turbulence to the air."""
    return add_to_air(memory, s, before)
