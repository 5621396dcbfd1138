"""Constant gravity."""

from typing import NamedTuple

from lapwing.dynamics.constants import STANDARD_GRAVITY
from lapwing.dynamics.effects._from_scene import Airframe, validate_table
from lapwing.dynamics.effects._hooks import field, wrench
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.vector import NOTHING

KIND = "gravity"


class Settings(NamedTuple):
    """No keys: gravity is in [environment]."""


class Gravity(NamedTuple):
    """Weight m g down (theory, eq. (2.1)).

    Source: the scene's gravity at sea level, independent of position. Valid to 0.03 % within 1 km of the sea level;
    `gravity_altitude` beyond that.
    """

    acceleration: float = STANDARD_GRAVITY  # [m/s^2]

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "Gravity":
        """Return the standard acceleration."""
        validate_table(Settings, table)
        return cls()

    def in_environment(self, environment: Environment) -> "Gravity":
        """Return the gravity at the scene's location."""
        return Gravity(environment.gravity)

    @property
    def acceleration_at_home(self) -> float:
        """[m/s^2] at the world frame's origin."""
        return self.acceleration


@field(Gravity)
def gravity_field(e, memory):
    """Return the acceleration [m/s^2] in world."""
    return (-0.0, -0.0, -e.acceleration)


@wrench(Gravity)
def gravity(e, memory, s, rotors):
    """Return the force [N] in world, torque [N m] in body coordinates."""
    return (-0.0, -0.0, -e.acceleration * s.body.mass), NOTHING
