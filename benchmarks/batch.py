"""Plant steps per second of a SIMD batch on all cores, compared with one vehicle after another.

    python -m benchmarks.batch [SCENES...]

Solver and communication steps of the scene; the best of several runs, which other work disturbs least.

Then steps of 1 ms per second of processor time against mujoco.rollout in one thread (extra `bench`), and the error of
the attitude after half a second of tumbling at 13 rad/s, against the same simulator at an eighth of the step.
"""

import time
from collections.abc import Callable
from statistics import median
from typing import Annotated, Any

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
TUMBLERS, TUMBLE_STEPS, TUMBLE_REPEATS, FINER = 512, 100, 5, 8
TUMBLE_STEP, TUMBLE_SECONDS = 1e-3, 0.5
HIGH, OMEGA = (0.0, 0.0, 2000.0), (10.0, -7.0, 4.0)  # [m], [rad/s]
VOLTS = 31.6
MASS, INERTIA, HUB = 10.0224, (0.27, 0.26, 0.42), 0.35171491  # [kg, kg m^2, m] of the delivery drone
SIGNS, TORQUE = ((1, 1), (-1, 1), (-1, -1), (1, -1)), 0.02  # of the hubs; [m] reaction torque to thrust


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
    try:
        from benchmarks._simulators import mujoco_sim
    except ImportError:
        print("MuJoCo is not installed: pip install 'lapwing[bench]'")
        return show(result)
    measured = [measure(lapwing_tumbler), measure(lambda n, step: mujoco_tumbler(mujoco_sim, n, step))]
    for name, (rate, error) in zip(("lapwing", "mujoco.rollout"), measured, strict=True):
        print(f"{name}: {1e-6 * rate:.2f} million steps/s a core, attitude error {error:.1e}")
    result.append(Row("batch to mujoco.rollout, steps a core", measured[0][0] / measured[1][0], "", 3.0, True))
    return show(result)


Tumbler = tuple[Callable[[int], None], Callable[[], np.ndarray]]  # advances by steps; attitude of the first vehicle


def lapwing_tumbler(n: int, step: float) -> Tumbler:
    batch = lapwing.BatchSimulator("hover", n, overrides=[f"solver.step={step}"])
    batch.reset(position_world=HIGH, omega_body=OMEGA, rotor_speed=batch.hover_speed)
    volts, steps = np.full((n, 4), VOLTS), batch._core.steps

    def advance(count: int) -> None:
        batch.step(motor_voltages=volts, ticks=count // steps)

    return advance, lambda: batch.state.attitude[0]


def mujoco_tumbler(sim: Any, n: int, step: float) -> Tumbler:
    """Return a free body with four rotors of constant thrust."""
    import mujoco
    from mujoco import rollout

    sites = "".join(f'<site name="r{k}" pos="{x * HUB} {y * HUB} 0"/>' for k, (x, y) in enumerate(SIGNS))
    motors = "".join(
        f'<motor site="r{k}" gear="0 0 1 0 0 {TORQUE * x * y}" ctrlrange="0 60"/>' for k, (x, y) in enumerate(SIGNS)
    )
    body = f"<body><freejoint/>{sim.inertial(INERTIA, MASS)}{sites}</body>"
    model = sim.model_of(body, step, "RK4", (0.0, 0.0, -9.81), '<flag contact="disable"/>', actuator=motors)
    data, spec = mujoco.MjData(model), mujoco.mjtState.mjSTATE_FULLPHYSICS
    data.qpos[:3], data.qvel[3:] = HIGH, OMEGA
    start = np.zeros(mujoco.mj_stateSize(model, spec))
    mujoco.mj_getState(model, data, start, spec)
    states = np.tile(start, (n, 1))

    def advance(count: int) -> None:
        states[:] = rollout.rollout(model, data, states, np.full((n, count, 4), MASS * 9.81 / 4))[0][:, -1]

    return advance, lambda: states[0, 4:8]  # after time and position


def measure(create: Callable[[int, float], Tumbler]) -> tuple[float, float]:
    """Return steps per second of processor time, and the largest error of the attitude's quaternion."""
    (advance, _), rates = create(TUMBLERS, TUMBLE_STEP), []
    advance(TUMBLE_STEPS)
    for _ in range(TUMBLE_REPEATS):
        began = time.process_time()
        advance(TUMBLE_STEPS)
        rates.append(TUMBLERS * TUMBLE_STEPS / (time.process_time() - began))
    ends = []
    for finer in (1, FINER):
        advance, attitude = create(2, TUMBLE_STEP / finer)
        advance(round(TUMBLE_SECONDS / TUMBLE_STEP) * finer)
        ends.append(attitude())
    return median(rates), float(min(np.abs(ends[0] - ends[1]).max(), np.abs(ends[0] + ends[1]).max()))


if __name__ == "__main__":
    command_line(main)
