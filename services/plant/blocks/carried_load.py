"""The load that vehicles of a fleet carry together: a point mass under the pull of their cables."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.dynamics.effects._types import Air
from lapwing.dynamics.effects._vehicle_interaction import NeighbourState
from lapwing.dynamics.integrators import RATES, integrate_fixed
from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.dynamics.vector import ZERO, Vec3, add, scale, subtract
from lapwing.dynamics.vehicles.multirotor_slung import Sling, load_acceleration, tension
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import map_tuple
from lapwing.services.common.ports import BodyMotions


class LoadPlant(NamedTuple):
    """The load and how it is integrated; tuples have an entry for each cable."""

    slings: tuple[Sling, ...]
    field: Vec3  # [m/s^2] of gravity
    method: Any  # `Method()` of an integrator
    step: float  # [s]
    steps: int  # of a tick
    interval: float  # [s] a tick


class LoadMotion(NamedTuple):
    """World frame ENU."""

    load_position: Vec3  # [m]
    load_velocity: Vec3  # [m/s]


class LoadDrive(NamedTuple):
    """Forces on the load over a communication step."""

    load: LoadPlant
    carriers: tuple[NeighbourState, ...]  # at its beginning
    start: float  # [s]


@always_inline
def _pull(c: Any, sling: Sling, carrier: NeighbourState) -> Vec3:
    """Return the force [N] of a cable on its hook, whose acceleration is constant over the step."""
    x, ahead = c
    velocity = add(carrier.hook_velocity, scale(ahead, carrier.hook_acceleration))
    way = scale(ahead, add(carrier.hook_velocity, scale(0.5 * ahead, carrier.hook_acceleration)))
    hook = add(carrier.hook_world, way)
    force, _ = tension(sling, subtract(x.load_position, hook), subtract(x.load_velocity, velocity))
    return force


@always_inline
def pulls(p: LoadDrive, t: float, x: LoadMotion) -> Vec3:
    """Return the force [N] of the load on all cables at time t [s]."""
    total = (0.0, 0.0, 0.0)
    for force in map_tuple(_pull, (x, t - p.start), p.load.slings, p.carriers):
        total = add(total, force)
    return total


@always_inline
def rate(p: LoadDrive, t: float, x: LoadMotion) -> LoadMotion:
    """Return the tangent of the load (theory.md, eq. (1.23))."""
    air = Air(p.carriers[0].air_density, p.carriers[0].wind_world)
    return LoadMotion(x.load_velocity, load_acceleration(p.load.slings[0], p.load.field, air, pulls(p, t, x), x))


RATES[LoadDrive] = rate


@always_inline
def _presence(_: float, received: InputSample, same: InputSample) -> NeighbourState:
    return received.value


@always_inline
def step(
    p: LoadPlant, s: LoadMotion, tick: int, inputs: tuple[InputSample, ...]
) -> tuple[LoadMotion, tuple[NeighbourState, BodyMotions], int]:
    """Advance the load to `tick` from its carriers' states of the previous tick; output it with the cables' force."""
    x, acceleration, force = s, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if inputs[0].due:
        drive = LoadDrive(p, map_tuple(_presence, 0.0, inputs, inputs), (tick - 1) * p.interval)
        x = integrate_fixed(p.method, drive, drive.start, x, p.step, p.steps)
        acceleration = rate(drive, tick * p.interval, x).load_velocity
        force = scale(-1.0, pulls(drive, tick * p.interval, x))
    place, velocity, zero = x.load_position, x.load_velocity, ((0.0, 0.0, 0.0),)
    sample = NeighbourState(
        place, velocity, ZERO, p.slings[0].load_mass, 0.0, 0.0, 0.0, 0.0, ZERO, place, velocity, acceleration, ZERO,
        tick * p.interval, True,
    )  # fmt: skip
    return x, (sample, BodyMotions((place,), (NO_ROTATION,), (velocity,), zero, (force,), zero)), CONTINUE
