"""Steps per second of the Gymnasium environments, compared with `Simulator` and `BatchSimulator` in one process.

    python -m benchmarks.environments [VEHICLES...]

A step is 20 ms of flight: five ticks of scene hover, each of four RK4 steps of 1 ms. All hover; `Simulator` under motor
voltages, with the scene's sensors; `BatchSimulator` under thrust and body rates, as the environments. They alternate
in short rounds. The best round, which other work disturbed least, is compared with the targets; the median shows how
busy the machine was.
"""

import time
from collections.abc import Callable
from statistics import median
from typing import Annotated

import gymnasium
import numpy as np
import typer

import lapwing
import lapwing.gym
from benchmarks._command import command_line
from benchmarks._targets import Row, show

VEHICLES = [64, 1024]
TICKS, ROUNDS, SECONDS = 5, 120, 0.02  # [s] duration of a round
SINGLE, SHARE = 20_000.0, 0.6  # targets: steps/s; ratio to the speed of a batch


def simulator() -> Callable[[], None]:
    """Return a step of one vehicle by `Simulator`, restarted at the end of its run."""
    sim = lapwing.Simulator("hover")

    def step() -> None:
        if sim.step(motor_voltages=(33.5,) * 4, ticks=TICKS).done:
            sim.reset()

    return step


def batch(n: int) -> Callable[[], None]:
    """Return a step of n vehicles by `BatchSimulator`."""
    vehicles = lapwing.BatchSimulator("hover", n)
    vehicles.reset(position_world=(0.0, 0.0, 5.0), rotor_speed=vehicles.hover_speed)
    thrust, rates = np.full(n, vehicles.weight), np.zeros((n, 3))
    return lambda: vehicles.step(thrust=thrust, body_rates=rates, ticks=TICKS) and None


def single() -> Callable[[], None]:
    """Return a step of `gymnasium.make`."""
    environment, action = gymnasium.make("lapwing/Hover-v0"), np.zeros(4, np.float32)
    environment.reset(seed=1)

    def step() -> None:
        *_, terminated, truncated, _ = environment.step(action)
        if terminated or truncated:
            environment.reset()

    return step


def vector(n: int) -> Callable[[], None]:
    """Return a step of `gymnasium.make_vec`."""
    environments = gymnasium.make_vec("lapwing/Hover-v0", num_envs=n, vectorization_mode="vector_entry_point")
    environments.reset(seed=1)
    actions = np.zeros((n, 4), np.float32)
    return lambda: environments.step(actions) and None


def rates(contestants: dict[str, tuple[int, Callable[[], None]]]) -> dict[str, list[float]]:
    """Return the vehicle steps per second of each contestant (vehicles, step) in each round."""
    measured: dict[str, list[float]] = {name: [] for name in contestants}
    for _, step in contestants.values():
        step()
    for _ in range(ROUNDS):
        for name, (n, step) in contestants.items():
            began, count = time.perf_counter(), 0
            while (took := time.perf_counter() - began) < SECONDS:
                step()
                count += n
            measured[name].append(count / took)
    return measured


def main(vehicles: Annotated[list[int], typer.Argument()] = VEHICLES) -> list[Row]:
    contestants = {"Simulator": (1, simulator()), "BatchSimulator, 1": (1, batch(1)), "gymnasium.make": (1, single())}
    for n in vehicles:
        contestants |= {f"BatchSimulator, {n}": (n, batch(n)), f"gymnasium.make_vec, {n}": (n, vector(n))}
    rounds = rates(contestants)
    print(f"{'steps/s':28}{'best round':>12}{'median':>12}{'ticks/s, best':>16}")
    for name, each in rounds.items():
        print(f"{name:28}{max(each):12,.0f}{median(each):12,.0f}{max(each) * TICKS:16,.0f}")
    result = {name: max(each) for name, each in rounds.items()}
    rows = [Row("gymnasium.make, steps", result["gymnasium.make"], "1/s", SINGLE, True)]
    for n in vehicles:
        share = result[f"gymnasium.make_vec, {n}"] / result[f"BatchSimulator, {n}"]
        rows.append(Row(f"gymnasium.make_vec to BatchSimulator, {n} vehicles", share, "1", SHARE, True))
    return show(rows)


if __name__ == "__main__":
    command_line(main)
