"""Load carried by several vehicles of a fleet with cables."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt, Le, Lt

from lapwing.dynamics.effects._from_scene import Airframe, validate_table
from lapwing.dynamics.effects._hooks import switches, wrench
from lapwing.dynamics.effects._vehicle_interaction import interaction
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.terrain import LEVEL
from lapwing.dynamics.vector import NOTHING, ZERO, Vec3, add, scale, subtract
from lapwing.dynamics.vehicles.multirotor_slung import Sling, SlungMotion, cable, cable_slackens
from lapwing.kernels import always_inline, math

Offset = Annotated[float, Ge(-100), Le(100)]


class Settings(NamedTuple):
    """Scene table."""

    mass: Annotated[float, Gt(0), Le(1e4)]  # [kg] of the load, not part of a vehicle's mass; the same for all
    length: Annotated[float, Gt(0), Le(1e3)]  # [m] of the vehicle's cable without tension
    stiffness: Annotated[float, Gt(0), Le(1e7)] = 2000.0  # [N/m] of the cable
    damping_ratio: Annotated[float, Ge(0), Lt(2)] = 0.1  # ratio, of the load on the taut cable
    hook: tuple[Offset, Offset, Offset] = (0.0, 0.0, 0.0)  # [m] body, where it is fastened
    drag_area: Annotated[float, Ge(0), Le(1e3)] = 0.0  # [m^2] drag coefficient of the load times area; the same for all


class SharedSlungLoad(NamedTuple):
    """Force of the cable to the shared load (theory, eq. (1.20), (1.23)).

    Source: Newton's laws; Hooke's law and a damper for a cable that only pulls. Load and vehicles are integrated
    separately. Each extrapolates the motion of the other from its acceleration at the start of the communication step.
    Valid while the frequency of the cable times the communication step is below 0.5.
    """

    sling: Sling

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "SharedSlungLoad":
        """Return the parameters with the damping for the airframe's mass."""
        settings = validate_table(Settings, table)
        reduced = 1.0 / (1.0 / settings.mass + 1.0 / airframe.mass.total)
        damping = 2.0 * settings.damping_ratio * math.sqrt(settings.stiffness * reduced)
        hook = subtract(settings.hook, airframe.mass.centre)
        return cls(Sling(settings.mass, settings.length, settings.stiffness, damping, hook, settings.drag_area, LEVEL))

    def in_environment(self, environment: Environment) -> "SharedSlungLoad":
        """Return the effect over the scene's terrain."""
        return SharedSlungLoad(self.sling._replace(terrain=environment.terrain))

    def initial_discrete_state(self) -> tuple[Vec3, Vec3, Vec3, float]:
        """Return the position, velocity and acceleration of the load at a time [s]; a negative time: unknown."""
        return ZERO, ZERO, ZERO, -1.0

    def presence(self) -> dict[str, Vec3]:
        """Return the attachment of its cable."""
        return {"hook_body": self.sling.hook_body}


@interaction(SharedSlungLoad)
def load_motion(e, memory, own, others, interval):
    """Return the position, velocity and acceleration of the load at the beginning of the coming interval."""
    for other in others:
        if other.is_load:
            return other.hook_world, other.hook_velocity, other.hook_acceleration, other.time
    return memory


@always_inline
def _with_load(memory, motion, t):
    """Return the SlungMotion of vehicle and load at t [s]."""
    place, velocity, acceleration, time = memory
    ahead = t - time
    place = add(place, scale(ahead, add(velocity, scale(0.5 * ahead, acceleration))))
    return SlungMotion(motion, place, add(velocity, scale(ahead, acceleration)))


@wrench(SharedSlungLoad)
def shared_slung_load(e, memory, s, rotors):
    """Return the force [N] of the cable in world coordinates and its torque [N m] in the body."""
    if memory[3] < 0.0:
        return (0.0, 0.0, 0.0), NOTHING
    return cable(e.sling, s.R_world_body, _with_load(memory, s.motion, s.t))


@switches(SharedSlungLoad)
def comes_taut_or_slack(e, memory, s, voltage, h):
    """Return True unless the cable stays taut, or the load is unknown."""
    return memory[3] >= 0.0 and cable_slackens(e.sling, s.R_world_body, _with_load(memory, s.motion, s.t), h)
