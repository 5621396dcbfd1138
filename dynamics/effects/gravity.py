"""Constant gravity."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Le

from dynamics.effects._hooks import field, wrench
from dynamics.vector import NOTHING

KIND = "gravity"


class Gravity(NamedTuple):
    """Weight m g down (theory.md, eq. (2.1)).

    Source: the standard acceleration of ISO 80000-3. Valid to 0.03 % within 500 m of the ground; `gravity_altitude`
    beyond that.
    """

    acceleration: Annotated[float, Ge(0), Le(30)] = 9.80665  # [m/s^2]

    @property
    def acceleration_at_home(self) -> float:
        """[m/s^2] at the world frame's origin."""
        return self.acceleration


@field(Gravity)
def gravity_field(e, memory):
    """Acceleration [m/s^2] in world."""
    return (-0.0, -0.0, -e.acceleration)


@wrench(Gravity)
def gravity(e, memory, s, rotors):
    """Force [N] in world, torque [N m] in body coordinates."""
    return (-0.0, -0.0, -e.acceleration * s.body.mass), NOTHING
