"""Choice of `solver.accuracy` in random scenes: error asked over error got, and cost over that of the cheapest solver.

    python -m benchmarks.solver_choice [--first N] [--count N]

Every candidate repeats the commands that the scene's own flight recorded with the reference (rkmk54, 64 steps in a
communication step), which is not that of the choice. docs/appendix/experiments.md has the figures.
"""

import math
from pathlib import Path
from typing import Annotated

import numpy as np
from typer import Option

from benchmarks._command import command_line
from lapwing.cosim.scene import Scene
from lapwing.dynamics import integrators
from lapwing.services.common.schemas.communication_schema import Communication
from lapwing.services.plant.schema import Solver
from lapwing.services.scene_resolver import load, parse, resolve
from lapwing.studies.accuracy.open_loop import fly_parts, starts_of_parts
from lapwing.studies.accuracy.own_flight import DIVISORS
from lapwing.studies.accuracy.scenes import FINEST
from lapwing.studies.accuracy.solver_selection import CANDIDATES, overrides
from lapwing.studies.accuracy.state_errors import TOPICS, differences_of_all, worst_of
from lapwing.studies.simulate import fly_with_ports

SLOW = True
ALWAYS = ("gravity", "rotor_thrust", "body_drag")
PLANTS = (  # vehicle, gains, and further effects
    ("delivery_drone", "tuned", ("ground_contact",)),
    ("delivery_drone", "tuned", ("air_density", "gyroscopic_torque", "wind_constant")),
    ("racer_250", "racer_250", ("air_density", "gyroscopic_torque", "ground_contact", "wind_constant")),
    ("hexacopter", "hexacopter", ("axial_inflow", "wind_von_karman")),
    ("delivery_drone", "tuned", ("battery", "dynamic_inflow")),
)


def draw(seed: int) -> Scene:
    """Return a scene with a random vehicle, wind, effects, trajectory, and accuracy."""
    rng = np.random.default_rng(seed)
    vehicle, gains, effects = PLANTS[seed % len(PLANTS)]
    points, scale = rng.uniform(-5.0, 5.0, (2, 4)), rng.uniform(0.5, 2.0)
    goals = [(0.0, 0.0, 4.0, 0.0), *((x, y, 4.0 + 0.5 * z, 0.3 * yaw) for x, y, z, yaw in points), (0.0, 0.0, 0.0, 0.0)]
    phases = ", ".join(
        f"{{name = 'p{i}', "
        + ", ".join(
            f"{axis} = {{kind = 'minimum_jerk', to = {value:.3f}, duration = {2.0 * scale:.2f}}}"
            for axis, value in zip(("x", "y", "z", "yaw"), goal, strict=True)
        )
        + "}"
        for i, goal in enumerate(goals)
    )
    wind = ", ".join(f"{v:.2f}" for v in rng.normal(0.0, 3.0, 2))
    tables = {"wind_constant": f"{{velocity = [{wind}, 0.0]}}", "wind_von_karman": "{wind_speed = 5.0}"}
    text = f"vehicle.airframe = '{vehicle}'\nautopilot = {{gains = '{gains}', estimator = 'ground_truth'}}\n"
    text += "".join(f"effects.{name} = {tables.get(name, '{}')}\n" for name in (*ALWAYS, *effects))
    return parse(Path(f"random_{seed}.toml"), text, [
        f"trajectory.phase=[{phases}]", f"run.seed={seed}", f"run.duration={8.0 * scale:.2f}",
        f"communication.rate={rng.choice([250, 500])}", f"solver.accuracy={10.0 ** rng.uniform(-8.0, -4.0):.2g}",
    ])  # fmt: skip


def solvers() -> list[tuple[str, int]]:
    """Return (integrator, steps in a communication step) of all candidates, by the evaluations that they need."""
    return sorted(((name, n) for name in CANDIDATES for n in DIVISORS), key=work)


def work(solver: tuple[str, int]) -> int:
    """Return the evaluations of a solver in a communication step."""
    return solver[1] * integrators.get(solver[0]).EVALUATIONS


def main(
    first: Annotated[int, Option(help="number of the first scene")] = 0,
    count: Annotated[int, Option(help="number of scenes")] = 40,
) -> None:
    print(f"{'scene':>5} {'asked':>8} {'got':>8} {'ratio':>8} {'cost':>5}  {'chosen':24} {'cheapest':24} worst of")
    rows = [row for row in map(measure, range(first, first + count)) if row]
    ratios, costs = np.array(rows).T
    free = (ratios > 100.0) & (costs == 1.0)
    print(f"{len(rows)} scenes: asked / got from {ratios.min():.2g}, median {np.median(ratios):.2g}, above 100 in "
          f"{(ratios > 100.0).sum()}, of these {free.sum()} without a cheaper solver; cost at most {costs.max():.2g} "
          f"times that of the cheapest, above 2 in {(costs > 2.0).sum()}")  # fmt: skip


def measure(seed: int) -> tuple[float, float] | None:
    """Print a scene, and return (asked / got, cost of the choice over that of the cheapest)."""
    scene = draw(seed)
    accuracy, interval = scene[Solver].accuracy or math.nan, scene[Communication].interval
    try:
        chosen = load(scene, overrides(scene, lambda _: None))
    except ValueError as error:
        print(f"{seed:5d} {accuracy:8.1e} refused: {error}", flush=True)
        return None

    def with_solver(name: str, n: int, error: float):
        step = interval / n
        return resolve(
            load(scene, [f"solver.integrator={name}", f"solver.step={step!r}", f"solver.accuracy={error!r}"])
        )

    flights, diagram = fly_with_ports(with_solver("rkmk54", FINEST, max(1e-3 * accuracy, 4e-10)), TOPICS)
    if flights[0].failure:
        raise ValueError(f"scene {seed}: {flights[0].failure}")
    starts = starts_of_parts(diagram)

    def error_of(solver: tuple[str, int]):
        config = with_solver(*solver, accuracy)._replace(last_tick=diagram.tick - 1)
        parts = fly_parts(diagram, starts, config, TOPICS)
        return worst_of(q for part in parts for q in differences_of_all(flights, part.flights, part.spans))

    own = chosen[Solver].integrator, chosen[Solver].steps(chosen[Communication])
    got = error_of(own)
    cheapest = next(s for s in solvers() if s == own or (work(s) < work(own) and error_of(s).error <= accuracy))
    ratio, cost = accuracy / got.error, work(own) / work(cheapest)
    texts = [f"{name} / {n}" for name, n in (own, cheapest)]
    numbers = f"{seed:5d} {accuracy:8.1e} {got.error:8.1e} {ratio:8.2g} {cost:5.2f}"
    print(f"{numbers}  {texts[0]:24} {texts[1]:24} {got.name}, {got.time:.2f} s", flush=True)
    return ratio, cost


if __name__ == "__main__":
    command_line(main)
