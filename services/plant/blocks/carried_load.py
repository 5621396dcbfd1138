"""Load that several vehicles of a fleet carry: a point mass under the tension of their cables.

The step error is controlled while a cable may become taut or slack, or the load touches the ground.
"""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.dynamics.effects._types import Air
from lapwing.dynamics.effects._vehicle_interaction import NeighbourState
from lapwing.dynamics.integrators import RATES, StepDoubling, integrate_step_doubling
from lapwing.dynamics.integrators import step as step_of_method
from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.dynamics.vector import ZERO, Vec3, add, scale, subtract
from lapwing.dynamics.vehicles.multirotor_slung import Sling, lands, load_acceleration, slackens, tension
from lapwing.kernels import always_inline, kernel
from lapwing.kernels.codegen import map_tuple, reduce_tuple
from lapwing.services.common.ports import BodyMotions


class LoadPlant(NamedTuple):
    """Parameters of the block: the load and its integration; tuples have an entry for each cable."""

    slings: tuple[Sling, ...]
    field: Vec3  # [m/s^2] gravity
    method: Any  # `Method()` of an integrator
    step: float  # [s]
    steps: int  # per tick
    interval: float  # [s] length of a tick
    tolerance: float  # tolerance of a substep while forces switch, relative to 1 + size


class LoadMotion(NamedTuple):
    """Motion of the load, world frame ENU."""

    load_position: Vec3  # [m]
    load_velocity: Vec3  # [m/s]


class LoadInputs(NamedTuple):
    """Forces on the load over a communication step."""

    load: LoadPlant
    carriers: tuple[NeighbourState, ...]  # states at its start
    start: float  # [s] start of the communication step


@always_inline
def _relative_to_hook(x: LoadMotion, elapsed: float, carrier: NeighbourState) -> LoadMotion:
    """Return the load's motion relative to a hook with a constant acceleration."""
    velocity = add(carrier.hook_velocity, scale(elapsed, carrier.hook_acceleration))
    displacement = scale(elapsed, add(carrier.hook_velocity, scale(0.5 * elapsed, carrier.hook_acceleration)))
    hook = add(carrier.hook_world, displacement)
    return LoadMotion(subtract(x.load_position, hook), subtract(x.load_velocity, velocity))


@always_inline
def _pull(c: Any, sling: Sling, carrier: NeighbourState) -> Vec3:
    """Return the force [N] of a cable on its hook."""
    x, elapsed = c
    offset, offset_rate = _relative_to_hook(x, elapsed, carrier)
    force, _ = tension(sling, offset, offset_rate)
    return force


@always_inline
def _slackens(c: Any, before: bool, sling: Sling, carrier: NeighbourState) -> bool:
    x, elapsed, h = c
    offset, offset_rate = _relative_to_hook(x, elapsed, carrier)
    return before or slackens(sling, offset, offset_rate, h)


@always_inline
def pulls(p: LoadInputs, t: float, x: LoadMotion) -> Vec3:
    """Return the force [N] of the load on all cables at time t [s]."""
    total = (0.0, 0.0, 0.0)
    for force in map_tuple(_pull, (x, t - p.start), p.load.slings, p.carriers):
        total = add(total, force)
    return total


@always_inline
def rate(p: LoadInputs, t: float, x: LoadMotion) -> LoadMotion:
    """Return the tangent of the load (theory, eq. (1.23))."""
    air = Air(p.carriers[0].air_density, p.carriers[0].wind_world)
    return LoadMotion(x.load_velocity, load_acceleration(p.load.slings[0], p.load.field, air, pulls(p, t, x), x))


RATES[LoadInputs] = rate


@always_inline
def _switches(p: LoadInputs, t: float, x: LoadMotion, h: float) -> bool:
    """Return True if a cable may slacken or the load may land within h [s]."""
    landing = lands(p.load.slings[0], x.load_position, x.load_velocity, h)
    return reduce_tuple(_slackens, (x, t - p.start, h), landing, p.load.slings, p.carriers)


@kernel
def move_load(p: LoadInputs, x: LoadMotion) -> LoadMotion:
    """Return the motion of the load a communication step later."""
    load = p.load
    for i in range(load.steps):
        t = p.start + i * load.step
        if _switches(p, t, x, load.step):
            adaptive = StepDoubling(load.method, load.tolerance)
            return integrate_step_doubling(adaptive, p, t, x, load.step, p.start + load.interval)
        x = step_of_method(load.method, p, t, x, load.step)
    return x


@always_inline
def _neighbour_state(_: float, received: InputSample, same: InputSample) -> NeighbourState:
    return received.value


@always_inline
def step(
    p: LoadPlant, s: LoadMotion, tick: int, inputs: tuple[InputSample, ...]
) -> tuple[LoadMotion, tuple[NeighbourState, BodyMotions], int]:
    """Advance the load to `tick` from its carriers' states of the previous tick; output it with the cables' force."""
    x, acceleration, force = s, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if inputs[0].due:
        u = LoadInputs(p, map_tuple(_neighbour_state, 0.0, inputs, inputs), (tick - 1) * p.interval)
        x = move_load(u, x)
        acceleration = rate(u, tick * p.interval, x).load_velocity
        force = scale(-1.0, pulls(u, tick * p.interval, x))
    position, velocity, zero = x.load_position, x.load_velocity, ((0.0, 0.0, 0.0),)
    sample = NeighbourState(
        position, velocity, ZERO, p.slings[0].load_mass, 0.0, 0.0, 0.0, 0.0, ZERO, position, velocity, acceleration,
        ZERO, tick * p.interval, True,
    )  # fmt: skip
    return x, (sample, BodyMotions((position,), (NO_ROTATION,), (velocity,), zero, (force,), zero)), CONTINUE
