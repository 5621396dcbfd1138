"""What vehicles of a fleet do to one another: the hook of effects that know of other vehicles, and what they know.

At every tick each vehicle gives its `NeighbourState`. One tick later, before it steps, the hook

    interact  (e, memory, own, others, interval) -> memory

of each such effect makes of its own presence and of those of the others, both of the tick before, what the effect
remembers for the coming exchange interval: a force, or a wind. Its other hooks (`_hooks`) act by that memory. A
parameter class says with `presence()` which numbers of the `NeighbourState` are the effect's own.
"""

from typing import Any, NamedTuple

from lapwing.dynamics.effects._hooks import HOOKS
from lapwing.dynamics.vector import ZERO, Vec3
from lapwing.kernels import DispatchTable, always_inline
from lapwing.kernels.codegen import compile_source, generated_overload


class NeighbourState(NamedTuple):
    """What others of a fleet may know of a vehicle at a tick, or of the load that some carry together."""

    position_world: Vec3 = ZERO  # [m] of the centre of mass
    velocity_world: Vec3 = ZERO  # [m/s]
    thrust_world: Vec3 = ZERO  # [N] of all rotors
    mass: float = 0.0  # [kg]
    air_density: float = 0.0  # [kg/m^3]
    radius: float = 0.0  # [m] of the sphere that others touch; 0: they pass through
    restitution: float = 0.0  # speed after a collision over that before
    disc_radius: float = 0.0  # [m] of one disc as large as all rotors' together; 0: no wash
    hook_body: Vec3 = ZERO  # [m] where its cable is fastened
    hook_world: Vec3 = ZERO  # [m] the same in the world
    hook_velocity: Vec3 = ZERO  # [m/s] world
    hook_acceleration: Vec3 = ZERO  # [m/s^2] world
    wind_world: Vec3 = ZERO  # [m/s]
    time: float = 0.0  # [s]
    is_load: bool = False


INTERACTION = HOOKS.setdefault("interaction", DispatchTable())


def interaction(parameters: type) -> Any:
    """Register the hook of a parameter class."""

    def register(function: Any) -> Any:
        INTERACTION[parameters] = always_inline(function)
        return INTERACTION[parameters]

    return register


def interacts(effects: tuple) -> bool:
    """Whether one of these effects knows of other vehicles."""
    return any(type(e) in INTERACTION for e in effects)


def presence(effects: tuple) -> NeighbourState:
    """What the effects of a vehicle say of it; the rest is for its state to fill in."""
    given = [e.presence() for e in effects if type(e) in INTERACTION]
    return NeighbourState(**{key: value for table in given for key, value in table.items()})


def _all_interactions(effects: Any, *_rest: Any) -> Any:
    names, members = {}, []
    for i, effect in enumerate(effects.types):
        known = effect.instance_class in INTERACTION
        if known:
            names[f"f{i}"] = INTERACTION[effect.instance_class]
        members.append(f"f{i}(effects[{i}], memory[{i}], own, others, interval)" if known else f"memory[{i}]")
    values = "".join(f"{member}, " for member in members)
    return compile_source("all_interactions(effects, memory, own, others, interval)", names, f"return ({values})")


all_interactions = generated_overload(
    "all_interactions(effects, memory, own, others, interval)",
    _all_interactions,
    "The effects' memory after each that knows of other vehicles has looked at them.",
    inline=True,
)
