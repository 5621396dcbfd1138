"""Plant steps per second of a SIMD batch on all cores, compared with one vehicle after another.

    python -m benchmarks.batch [SCENES...]

Solver and communication steps of the scene; the best of several runs, which other work disturbs least.
"""

import time
from typing import Annotated

import llvmlite.binding as llvm
import numpy as np
import typer

import lapwing
from benchmarks._command import command_line
from benchmarks._targets import Row, show
from lapwing.dynamics import simd_batch as kernels
from lapwing.dynamics.vehicles import multirotor
from lapwing.kernels import kernel
from lapwing.services.scene_resolver import load, resolve

SCENES = ["hover", "delivery_mission"]
N, TICKS, REPETITIONS = 2048, 10, 300  # runs of a millisecond, so that most are not interrupted


@kernel
def one(method, p, key, state, command, h, n, ticks):
    for tick in range(ticks):
        state = multirotor.advance(method, p, key, tick, state, command, h, n)
    return state


def best(run):
    run()
    times = []
    for _ in range(REPETITIONS):
        started = time.perf_counter()
        run()
        times.append(time.perf_counter() - started)
    return min(times)


def rates(scene: str) -> tuple[float, float, float]:
    """Return 10^6 steps/s of a scene's plant: batch on all cores, batch on one core, and one vehicle after another."""
    batch = lapwing.BatchSimulator(scene, N)
    batch.reset(position_world=(0.0, 0.0, 2000.0), rotor_speed=np.full(4, 330.0))
    core, volts = batch._core, np.full((N, 4), 31.6)
    options = (core.method, batch._like, batch._blocks.reshape(-1), batch._blocks.shape[1], batch._keys, batch._ticks)
    together = best(lambda: batch._advance(volts, TICKS))
    single = best(lambda: kernels.advance(*options, volts, None, core.step, core.steps, 0, N // kernels.WIDTH, TICKS))
    state = resolve(load(scene)).services["plant"].parameters.start.vehicle
    high = state.motion._replace(position_world=(0.0, 0.0, 2000.0), rotor_speed=(330.0,) * 4)
    start = state._replace(motion=high)
    alone = best(
        lambda: one(core.method, core.vehicle, core.key, start, (31.6,) * 4, core.step, core.steps, 40 * TICKS)
    )
    steps = 1e-6 * core.steps * TICKS
    return N * steps / together, N * steps / single, 40 * steps / alone


def main(scenes: Annotated[list[str], typer.Argument()] = SCENES) -> list[Row]:
    bar = 200.0 if "avx512f" in llvm.get_host_cpu_features() else 100.0
    result = []
    for scene in scenes:
        together, single, alone = rates(scene)
        print(f"{scene}: one core {single:.1f}, one vehicle after the other {alone:.1f} million steps/s")
        result.append(Row(f"batch, all cores, {scene}, million steps/s", together, "", bar, True))
    return show(result)


if __name__ == "__main__":
    command_line(main)
