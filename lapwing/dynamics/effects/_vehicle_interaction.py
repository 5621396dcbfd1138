"""Interaction of vehicles in a fleet: the hook of interacting effects, and the state that they share.

At every tick each vehicle outputs its `NeighbourState`. One tick later, before it steps, the hook

    interact  (e, memory, own, others, interval) -> memory

of each such effect computes its discrete state for the coming communication step, such as a force or a wind, from its
own state and those of the others, both of the previous tick. Its other hooks (`_hooks`) use that discrete state. A
parameter class defines with `presence()` which numbers of the `NeighbourState` are the effect's own.
"""

from typing import Any, NamedTuple

from lapwing.dynamics.effects._hooks import HOOKS
from lapwing.dynamics.vector import ZERO, Mat3, Vec3
from lapwing.kernels import DispatchTable, always_inline
from lapwing.kernels.codegen import compile_source, generic


class NeighbourState(NamedTuple):
    """State of a vehicle, or of a shared load, for the other vehicles of a fleet at a tick."""

    position_world: Vec3 = ZERO  # [m] of the centre of mass
    velocity_world: Vec3 = ZERO  # [m/s]
    thrust_world: Vec3 = ZERO  # [N] of all rotors
    mass: float = 0.0  # [kg]
    air_density: float = 0.0  # [kg/m^3]
    radius: float = 0.0  # [m] of the sphere that others touch; 0: they pass through
    restitution: float = 0.0  # speed after a collision over that before
    disc_radius: float = 0.0  # [m] of one disc as large as all rotors' together; 0: no wash
    hook_body: Vec3 = ZERO  # [m] attachment of its cable
    hook_world: Vec3 = ZERO  # [m] attachment of its cable, world
    hook_velocity: Vec3 = ZERO  # [m/s] world
    hook_acceleration: Vec3 = ZERO  # [m/s^2] world
    wind_world: Vec3 = ZERO  # [m/s]
    time: float = 0.0  # [s]
    is_load: bool = False
    friction: float = 0.0  # coefficient of the sphere's surface
    omega_world: Vec3 = ZERO  # [rad/s]
    inverse_inertia_world: Mat3 = (0.0,) * 9  # [1/(kg m^2)] about the centre of mass


INTERACTION = HOOKS.setdefault("interaction", DispatchTable())


def interaction(parameters: type) -> Any:
    """Register the hook of a parameter class."""

    def register(function: Any) -> Any:
        INTERACTION[parameters] = always_inline(function)
        return INTERACTION[parameters]

    return register


def interacts(effects: tuple) -> bool:
    """Return True if one of these effects interacts with other vehicles."""
    return any(type(e) in INTERACTION for e in effects)


def presence(effects: tuple) -> NeighbourState:
    """Return the neighbour state with the effects' part; the vehicle's state fills in the rest."""
    tables = [e.presence() for e in effects if type(e) in INTERACTION]
    return NeighbourState(**{key: value for table in tables for key, value in table.items()})


@generic(inline=True)
def all_interactions(effects: Any, memory: Any, own: Any, others: Any, interval: Any) -> Any:
    """Return the effects' memory after the hooks of interacting effects."""
    names, members = {}, []
    for i, effect in enumerate(effects.types):
        known = effect.instance_class in INTERACTION
        if known:
            names[f"f{i}"] = INTERACTION[effect.instance_class]
        members.append(f"f{i}(effects[{i}], memory[{i}], own, others, interval)" if known else f"memory[{i}]")
    values = "".join(f"{member}, " for member in members)
    return compile_source("all_interactions(effects, memory, own, others, interval)", names, f"return ({values})")
