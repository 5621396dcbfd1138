"""Gravity that weakens with altitude."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Le

from dynamics.effects._hooks import field, sample, wrench
from dynamics.kernel import leaf
from dynamics.vector import NOTHING

KIND = "gravity"
EARTH_RADIUS = 6_356_766.0  # [m] the U.S. Standard Atmosphere's


class GravityAltitude(NamedTuple):
    """Weight m g (R / (R + h))^2 down (theory.md, eq. (2.2)).

    Source: Newton's law with the radius of the U.S. Standard Atmosphere 1976; brought up to date once an exchange
    interval. Valid wherever there is air.
    """

    acceleration: Annotated[float, Ge(0), Le(30)] = 9.80665  # [m/s^2] at sea level
    home_altitude: Annotated[float, Ge(-500), Le(9000)] = 0.0  # [m] of the world frame's origin above the sea

    @property
    def acceleration_at_home(self) -> float:
        """[m/s^2] at the world frame's origin."""
        return _at(self, 0.0)

    def initial_memory(self) -> tuple[float]:
        """Acceleration at home [m/s^2]."""
        return (self.acceleration_at_home,)


@leaf
def _at(e, height):
    ratio = EARTH_RADIUS / (EARTH_RADIUS + e.home_altitude + height)
    return e.acceleration * ratio * ratio


@sample(GravityAltitude)
def weigh(e, memory, s, rotors, key, tick, interval):
    """The acceleration [m/s^2] for the next interval: it changes by 3e-7 of itself a metre."""
    return (_at(e, s.motion.position_world[2]),)


@field(GravityAltitude)
def gravity_altitude_field(e, memory):
    """Acceleration [m/s^2] in world."""
    return (-0.0, -0.0, -memory[0])


@wrench(GravityAltitude)
def gravity_altitude(e, memory, s, rotors):
    """Force [N] in world, torque [N m] in body coordinates."""
    return (-0.0, -0.0, -memory[0] * s.body.mass), NOTHING
