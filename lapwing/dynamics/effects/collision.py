"""Collisions between vehicles of a fleet."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt, Le

from lapwing.dynamics.effects._from_scene import Airframe, reject, validate_table
from lapwing.dynamics.effects._hooks import wrench
from lapwing.dynamics.effects._vehicle_interaction import interaction
from lapwing.dynamics.vector import NOTHING, ZERO, Vec3, add, apply, apply_transposed, cross, dot, norm, scale, subtract
from lapwing.kernels import always_inline, math

PUSH = 0.05  # share of the penetration that is corrected in each communication step


class Settings(NamedTuple):
    """Scene table."""

    radius: Annotated[float, Gt(0), Le(100)] | None = None  # [m] about the centre of mass; to the rotors' tips
    restitution: Annotated[float, Ge(0), Le(1)] = 0.3  # coefficient of restitution; of two vehicles the lower applies
    friction: Annotated[float, Ge(0), Le(2)] = 0.0  # coefficient of friction; of two vehicles the lower applies


class Collision(NamedTuple):
    """Spheres with elastic impact and friction (theory, eq. (2.60), (2.61), (2.77)).

    An impulse along the line of centres and a friction impulse against the slip act on both vehicles as a force and a
    torque over one communication step, so that momentum and angular momentum are conserved. Source: Newton's law of
    impact, Coulomb's of friction (Walton, 1993); Baumgarte's correction of the depth. Valid while a vehicle moves by a
    small part of its radius in a communication step; collisions cause no damage.
    """

    radius: float  # [m]
    restitution: float
    friction: float

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "Collision":
        """Return the parameters with a sphere around the rotors, unless the table has its own."""
        settings = validate_table(Settings, table)
        radius = settings.radius
        if radius is None:
            propeller = airframe.propeller or reject("needs the key radius: the vehicle has no [propeller]")
            radius = max(math.hypot(*place) for place in airframe.rotors.position) + 0.5 * propeller.diameter
        return cls(radius, settings.restitution, settings.friction)

    def initial_discrete_state(self) -> tuple[Vec3, Vec3]:
        """Return zero force [N] and torque [N m] of others, world."""
        return ZERO, ZERO

    def presence(self) -> dict[str, float]:
        """Return the sphere."""
        return {"radius": self.radius, "restitution": self.restitution, "friction": self.friction}


@always_inline
def _compliance(state, arm, normal, along):
    """Return the change of speed along a unit vector at the contact, by an impulse of 1 N s along it [1/kg]."""
    turning = scale(arm, cross(normal, along))
    return 1.0 / state.mass + dot(turning, apply(state.inverse_inertia_world, turning))


@interaction(Collision)
def touch(e, memory, own, others, interval):
    """Return the force [N] and torque [N m] of all touching spheres for the coming interval, world."""
    force, torque = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for other in others:
        apart = subtract(own.position_world, other.position_world)
        distance = norm(apart)
        depth = own.radius + other.radius - distance
        if depth <= 0.0 or distance == 0.0 or other.radius == 0.0:
            continue
        normal = scale(1.0 / distance, apart)
        relative = subtract(own.velocity_world, other.velocity_world)
        parting = dot(normal, relative)
        desired = max(-min(own.restitution, other.restitution) * parting, PUSH * depth / interval)
        if desired <= parting:
            continue
        reduced = own.mass * other.mass / (own.mass + other.mass)
        push = reduced * (desired - parting) / interval  # [N]
        force = add(force, scale(push, normal))
        rough = min(own.friction, other.friction)
        if rough == 0.0:
            continue
        # the contact divides the distance in proportion to the radii, so that angular momentum is conserved
        arm = own.radius * distance / (own.radius + other.radius)
        reach = other.radius * distance / (own.radius + other.radius)
        turning = add(scale(arm, own.omega_world), scale(reach, other.omega_world))
        slip = subtract(subtract(relative, scale(parting, normal)), cross(turning, normal))
        speed = norm(slip)
        if speed == 0.0:
            continue
        along = scale(1.0 / speed, slip)
        stop = (
            speed / (_compliance(own, arm, normal, along) + _compliance(other, reach, normal, along)) / interval
        )  # [N]
        rub = min(rough * push, stop)
        force = subtract(force, scale(rub, along))
        torque = add(torque, scale(arm * rub, cross(normal, along)))
    return force, torque


@wrench(Collision)
def collision(e, memory, s, rotors):
    """Return force [N] in world coordinates at the centre of mass, torque [N m] in body coordinates."""
    if e.friction == 0.0:
        return memory[0], NOTHING
    return memory[0], apply_transposed(s.R_world_body, memory[1])
