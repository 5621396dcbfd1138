"""Vehicles of a fleet that touch one another."""

from typing import TYPE_CHECKING, Annotated, NamedTuple

from annotated_types import Ge, Gt, Le

from lapwing.dynamics.effects._from_scene import checked, reject
from lapwing.dynamics.effects._hooks import wrench
from lapwing.dynamics.effects._vehicle_interaction import interaction
from lapwing.dynamics.vector import NOTHING, ZERO, add, dot, norm, scale, subtract
from lapwing.kernels import math

if TYPE_CHECKING:  # a process that flies has no need of pydantic
    from lapwing.dynamics.vehicles.airframe import Airframe

PUSH = 0.05  # of the depth that spheres are in one another, taken back in each exchange interval


class Settings(NamedTuple):
    """What a scene says."""

    radius: Annotated[float, Gt(0), Le(100)] | None = None  # [m] about the centre of mass; to the rotors' tips
    restitution: Annotated[float, Ge(0), Le(1)] = 0.3  # speed of parting over that of approach; of two the lower


class Collision(NamedTuple):
    """Spheres without friction that bounce off one another (theory.md, eq. (2.60), (2.61)).

    An impulse along the line of centres, given as a force over one exchange interval and to both alike, so that
    momentum is kept. Source: Newton's law of impact; depth taken back after Baumgarte. Valid while a vehicle moves by
    little of its radius in an exchange interval; vehicles neither turn nor break by it.
    """

    radius: float  # [m]
    restitution: float

    @classmethod
    def from_scene(cls, table: dict, airframe: "Airframe") -> "Collision":
        """With a sphere around the rotors unless the table has its own."""
        given = checked(Settings, table)
        radius = given.radius
        if radius is None:
            propeller = airframe.propeller or reject("needs the key radius: the vehicle has no [propeller]")
            radius = max(math.hypot(*place) for place in airframe.rotors.position) + 0.5 * propeller.diameter
        return cls(radius, given.restitution)

    def initial_discrete_state(self) -> tuple[float, float, float]:
        """The force of others [N], world."""
        return ZERO

    def presence(self) -> dict[str, float]:
        """The sphere."""
        return {"radius": self.radius, "restitution": self.restitution}


@interaction(Collision)
def touch(e, memory, own, others, interval):
    """The force of all that it touches, over the coming interval."""
    force = (0.0, 0.0, 0.0)
    for other in others:
        apart = subtract(own.position_world, other.position_world)
        distance = norm(apart)
        depth = own.radius + other.radius - distance
        if depth <= 0.0 or distance == 0.0 or other.radius == 0.0:
            continue
        normal = scale(1.0 / distance, apart)
        parting = dot(normal, subtract(own.velocity_world, other.velocity_world))
        wanted = max(-min(own.restitution, other.restitution) * parting, PUSH * depth / interval)
        if wanted > parting:
            reduced = own.mass * other.mass / (own.mass + other.mass)
            force = add(force, scale(reduced * (wanted - parting) / interval, normal))
    return force


@wrench(Collision)
def collision(e, memory, s, rotors):
    """Force [N] in world coordinates at the centre of mass, no torque."""
    return memory, NOTHING
