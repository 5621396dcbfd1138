"""Constant force and torque in body axes."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Le

from lapwing.dynamics.effects._from_scene import Airframe, validate_table
from lapwing.dynamics.effects._hooks import wrench_body
from lapwing.dynamics.vector import Vec3

Force = Annotated[float, Ge(-1e4), Le(1e4)]
Torque = Annotated[float, Ge(-1e4), Le(1e4)]


class Settings(NamedTuple):
    """Keys of the scene's table."""

    force: tuple[Force, Force, Force] = (0.0, 0.0, 0.0)  # [N] at the centre of mass, body
    torque: tuple[Torque, Torque, Torque] = (0.0, 0.0, 0.0)  # [N m] body


class BodyWrench(NamedTuple):
    """Constant force and torque in body axes, the trim of a real vehicle (theory, eq. (2.65)).

    It represents loads that are constant over seconds and that no other effect explains: a shifted centre of mass,
    unequal motors, a bent arm. Source: the output bias of output-error estimation, Jategaonkar, Flight Vehicle System
    Identification (2015), section 4. Valid while these causes are constant in the body.
    """

    force: Vec3  # [N]
    torque: Vec3  # [N m]

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "BodyWrench":
        """Take both from the scene's table."""
        settings = validate_table(Settings, table)
        return cls(settings.force, settings.torque)


@wrench_body(BodyWrench)
def body_wrench(e, memory, s, rotors):
    """Return the force [N] and torque [N m] in body coordinates."""
    return e.force, e.torque
