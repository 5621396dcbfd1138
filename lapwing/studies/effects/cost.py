"""Cost of the plant's step with a set of effects, in the air and on the ground."""

import math
import time
from typing import Any, NamedTuple

import numpy as np

from lapwing.cosim.scene import Scene
from lapwing.dynamics.noise import Key, stream_key
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.multirotor_equations import STANDARD_DENSITY, with_tolerance
from lapwing.kernels import kernel
from lapwing.kernels.cell import Cell
from lapwing.services.common.vehicle_schema import active, airframe, rotor_constants, start_height
from lapwing.services.plant.schema import Solver, method
from lapwing.studies.effects.variants import Tables, variant

STEPS = 2000  # steps in one timed call
ROUNDS = 60  # calls of each variant, interleaved so that disturbances affect all variants
HEIGHT = 10.0  # [m]
STANDARD_GRAVITY = 9.81  # [m/s^2]


class Cost(NamedTuple):
    """Time of a plant step [ns], and difference of two halves of the measurement."""

    airborne: float  # hovering at 10 m
    standing: float  # on the ground with the motors off
    airborne_noise: float
    standing_noise: float


@kernel
def exchanges(method: Any, p: Any, s: Any, key: Key, command: tuple[float, ...], h: float, n: int, ticks: int) -> None:
    """Advance the state in the cell `s` by `ticks` exchanges of n steps of h [s]."""
    for tick in range(ticks):
        s.value = multirotor.advance(method, p.value, key, tick, s.value, command, h, n)


def costs(scene: Scene, variants: list[Tables]) -> list[Cost]:
    """Return the cost of a plant step of each variant."""
    calls = [_calls(variant(scene, tables)) for tables in variants]
    times = np.empty((ROUNDS, len(variants), 2))
    for row in times:
        for i, pair in enumerate(calls):
            for j, call in enumerate(pair):
                row[i, j] = call()
    # interruptions only add time, so the minimum is the best estimate
    odd, even = (times[begin::2].min(axis=0) / STEPS * 1e9 for begin in (1, 2))
    return [Cost(*np.minimum(a, b), *np.abs(a - b)) for a, b in zip(odd, even, strict=True)]


def _calls(scene: Scene) -> tuple[Any, Any]:
    frame = airframe(scene)
    p = with_tolerance(multirotor.parameters(frame, active(scene)), scene[Solver].contact_tolerance)
    rotor = rotor_constants(scene)
    lift = (STANDARD_DENSITY if rotor.with_density else 1.0) * rotor.thrust
    speed = math.sqrt(frame.mass.total * STANDARD_GRAVITY / (len(frame.rotors.position) * lift))
    voltage = speed / p.layout.speed_per_volt
    return _call(scene, p, HEIGHT, speed, voltage), _call(scene, p, start_height(scene), 0.0, 0.0)


def _call(scene: Scene, p: Any, height: float, speed: float, voltage: float) -> Any:
    start = multirotor.initial_state(p, (0.0, 0.0, height), rotor_speed=speed)
    parameters, command = Cell(p), (voltage,) * len(p.layout.x_body)
    integrator, steps, step = method(scene)
    key = stream_key(1, "drone1", "plant")

    def call() -> float:
        state = Cell(start)
        started = time.perf_counter()
        exchanges(integrator, parameters, state, key, command, step, steps, STEPS // steps)
        return time.perf_counter() - started

    return call
