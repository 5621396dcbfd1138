"""Gravity as a function of altitude."""

from typing import NamedTuple

from lapwing.dynamics.atmosphere import EARTH_RADIUS
from lapwing.dynamics.constants import STANDARD_GRAVITY
from lapwing.dynamics.effects._from_scene import Airframe, validate_table
from lapwing.dynamics.effects._hooks import discrete_update, field, wrench
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.geodesy import Home, height_above_home
from lapwing.dynamics.vector import NOTHING, ZERO
from lapwing.kernels import always_inline, python_function

KIND = "gravity"


class Settings(NamedTuple):
    """No keys: gravity and the altitude of home are in [environment]."""


class GravityAltitude(NamedTuple):
    """Weight m g (R / (R + h))^2 down (theory, eq. (2.2)).

    Source: Newton's law with the radius of the U.S. Standard Atmosphere 1976; updated once per communication step.
    Valid within the atmosphere.
    """

    acceleration: float = STANDARD_GRAVITY  # [m/s^2] at sea level
    home: Home = Home(height=0.0)

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "GravityAltitude":
        """Return the standard acceleration at sea level."""
        validate_table(Settings, table)
        return cls()

    def in_environment(self, environment: Environment) -> "GravityAltitude":
        """Return the gravity at the scene's location."""
        return GravityAltitude(environment.gravity, environment.home)

    @property
    def acceleration_at_home(self) -> float:
        """[m/s^2] at the world frame's origin."""
        return float(python_function(_at)(self, ZERO))

    def initial_discrete_state(self) -> tuple[float]:
        """Return the acceleration at home [m/s^2]."""
        return (self.acceleration_at_home,)


@always_inline
def _at(e, position_world):
    ratio = EARTH_RADIUS / (EARTH_RADIUS + e.home.height + height_above_home(e.home, position_world))
    return e.acceleration * ratio * ratio


@discrete_update(GravityAltitude)
def weigh(e, memory, s, rotors, key, tick, interval):
    """Return the acceleration [m/s^2] for the next interval; it changes by 3e-7 of its value per metre."""
    return (_at(e, s.motion.position_world),)


@field(GravityAltitude)
def gravity_altitude_field(e, memory):
    """Return the acceleration [m/s^2] in world."""
    return (-0.0, -0.0, -memory[0])


@wrench(GravityAltitude)
def gravity_altitude(e, memory, s, rotors):
    """Return the force [N] in world, torque [N m] in body coordinates."""
    return (-0.0, -0.0, -memory[0] * s.body.mass), NOTHING
