"""Cost of the plant's step of all vehicles with a set of effects, in the air and on the ground.

The steps of several vehicles are measured one by one, and vehicles with equal parameters once. A step includes the
hooks of the effects that interact with other vehicles. Not included are the outputs of the plant, such as the state for
the other vehicles, and the motion of a shared load, whose cables are slack.
"""

import math
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import types

from lapwing.cosim.scene import Scene
from lapwing.dynamics.constants import STANDARD_GRAVITY
from lapwing.dynamics.effects._vehicle_interaction import NeighbourState, all_interactions, interacts, presence
from lapwing.dynamics.effects.shared_slung_load import SharedSlungLoad
from lapwing.dynamics.noise import Key, stream_key
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.multirotor_equations import (
    STANDARD_DENSITY,
    MultirotorParameters,
    MultirotorState,
    with_tolerance,
)
from lapwing.kernels import kernel
from lapwing.kernels.cell import Cell
from lapwing.kernels.codegen import compile_source, generic
from lapwing.services.common.schemas.vehicle_schema import active, airframe, rotor_constants, start_height
from lapwing.services.plant.schema import Solver, method
from lapwing.studies.effects.variants import Tables, variant

STEPS = 2000  # steps in one timed call
ROUNDS = 60  # calls of each variant, interleaved so that disturbances affect all variants
HEIGHT = 10.0  # [m]
SPACING = 5.0  # [m] between the vehicles of a fleet, which do not touch or enter another one's wake


class Cost(NamedTuple):
    """CPU time of a plant step [ns] of all vehicles, and difference of two halves of the measurement."""

    airborne: float  # hovering at 10 m
    standing: float  # on the ground with the motors off
    airborne_noise: float
    standing_noise: float


class _Plant(NamedTuple):
    """Plant of a vehicle."""

    p: MultirotorParameters
    speed: float  # [rad/s] of the rotors, hovering
    height: float  # [m] at its start
    solver: Solver

    def neighbour(self, i: int, height: float, thrust: float) -> NeighbourState:
        """Return its state as the i-th of a row of vehicles."""
        place, mass = (i * SPACING, 0.0, height), self.p.body.mass
        example = presence(self.p.effects)
        return example._replace(
            position_world=place, thrust_world=(0.0, 0.0, thrust), mass=mass, air_density=STANDARD_DENSITY
        )


@generic(inline=True)
def _with_interactions(effects: Any, memory: Any, states: types.BaseTuple, interval: Any) -> Callable:
    """Return the effects' discrete state after the hooks of interacting effects; `states` begins with its own."""
    hooks = "all_interactions(effects, memory, states[0], states[1:], interval)" if len(states) > 1 else "memory"
    names = {"all_interactions": all_interactions}
    return compile_source("_with_interactions(effects, memory, states, interval)", names, f"return {hooks}")


@kernel
def exchanges(
    method: Any,
    p: Any,
    s: Any,
    states: Any,
    key: Key,
    command: tuple[float, ...],
    h: float,
    n: int,
    ticks: int,
) -> None:
    """Advance the state in the cell `s` by `ticks` exchanges of n steps of h [s]; others have constant states."""
    for tick in range(ticks):
        x = s.value
        memory = _with_interactions(p.value.effects, x.memory, states.value, n * h)
        s.value = multirotor.advance(method, p.value, key, tick, MultirotorState(x.motion, memory), command, h, n)


def costs(scene: Scene, variants: list[Tables], report: Callable[[int], None] = lambda loaded: None) -> list[Cost]:
    """Return the cost of a plant step of each variant.

    Args:
        scene: scene of multirotors.
        variants: effects of each variant.
        report: called with the number of variants whose kernels are compiled or loaded; then all are measured.
    """
    calls = [_calls(variant(scene, tables)) for tables in variants]
    for loaded, each in enumerate(calls):
        report(loaded)
        for call in (call for _, *pair in each for call in pair):
            call()
    report(len(calls))
    times = [np.empty((ROUNDS, len(each), 2)) for each in calls]
    for i in range(ROUNDS):
        for each, rows in zip(calls, times, strict=True):
            for j, (_, *pair) in enumerate(each):
                rows[i, j] = [call() for call in pair]
    return [_cost(rows, [number for number, *_ in each]) for each, rows in zip(calls, times, strict=True)]


def _cost(times: np.ndarray, numbers: list[int]) -> Cost:
    """Return the cost from the times [s] of each round and distinct vehicle, in the air and on the ground."""
    # interruptions only add time, so the minimum is the best estimate
    odd, even = (np.array(numbers) @ times[begin::2].min(axis=0) / STEPS * 1e9 for begin in (0, 1))
    return Cost(*np.minimum(odd, even), *np.abs(odd - even))


def _calls(scene: Scene) -> list[tuple[int, Any, Any]]:
    """Return (number of equal vehicles, call in the air, call on the ground) of each distinct vehicle."""
    plants = [_plant(vehicle) for vehicle in scene.each_vehicle]
    distinct: dict[str, list[Any]] = {}
    for plant, vehicle in zip(plants, scene.each_vehicle, strict=True):
        others = plants if interacts(plant.p.effects) else []
        fleet = [plant, *(other for other in others if other is not plant and interacts(other.p.effects))]
        distinct.setdefault(repr(fleet), [vehicle, fleet, 0])[2] += 1
    return [(number, *_pair(vehicle, fleet)) for vehicle, fleet, number in distinct.values()]


def _plant(scene: Scene) -> _Plant:
    frame = airframe(scene)
    p = with_tolerance(multirotor.parameters(frame, active(scene)), scene[Solver].contact_tolerance)
    rotor = rotor_constants(scene)
    lift = (STANDARD_DENSITY if rotor.with_density else 1.0) * rotor.thrust
    speed = math.sqrt(frame.mass.total * STANDARD_GRAVITY / (len(frame.rotors.position) * lift))
    return _Plant(p, speed, start_height(scene), scene[Solver])


def _pair(scene: Scene, fleet: list[_Plant]) -> tuple[Any, Any]:
    """Return the calls of the first of several vehicles in the air and on the ground."""
    first = fleet[0]
    in_air = [plant.neighbour(i, HEIGHT, plant.p.body.mass * STANDARD_GRAVITY) for i, plant in enumerate(fleet)]
    on_ground = [plant.neighbour(i, plant.height, 0.0) for i, plant in enumerate(fleet)]
    return _call(scene, first, in_air, first.speed), _call(scene, first, on_ground, 0.0)


def _call(scene: Scene, plant: _Plant, states: list[NeighbourState], speed: float) -> Any:
    p, height = plant.p, states[0].position_world[2]
    if sling := next((e.sling for e in p.effects if isinstance(e, SharedSlungLoad)), None):
        place = 0.0, 0.0, height - 0.5 * sling.length
        states = [*states, NeighbourState(is_load=True, hook_world=place)]
    voltage = speed / p.layout.speed_per_volt
    start = multirotor.initial_state(p, (0.0, 0.0, height), rotor_speed=speed)
    parameters, fixed, command = Cell(p), Cell(tuple(states)), (voltage,) * len(p.layout.x_body)
    integrator, steps, step = method(scene)
    key = stream_key(1, "drone1", "plant")

    def call() -> float:
        state = Cell(start)
        started = time.thread_time()
        exchanges(integrator, parameters, state, fixed, key, command, step, steps, STEPS // steps)
        return time.thread_time() - started

    return call
