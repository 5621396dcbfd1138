"""`lapwing accuracy`: study of a target, with printed, written and plotted results."""

import math
from collections.abc import Callable
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import NamedTuple

from rich.box import SIMPLE
from rich.console import Console

from lapwing.cosim.scene import Scene
from lapwing.dynamics.config_error import ConfigError
from lapwing.kernels import statistics
from lapwing.services.plant.schema import Solver, accuracy_to_select_for
from lapwing.services.scene_resolver import load
from lapwing.studies import json_file
from lapwing.studies.accuracy import error_budget, round_off, scenes, solver_selection
from lapwing.studies.accuracy.error_budget import ErrorSource
from lapwing.studies.accuracy.problem import Problem
from lapwing.studies.accuracy.round_off import RoundOff
from lapwing.studies.accuracy.targets import find, scene_of
from lapwing.studies.accuracy.work_precision import (
    Point,
    cheapest,
    check_target,
    measure,
    pareto_points,
    smallest_error,
)
from lapwing.studies.effects.cost import costs
from lapwing.studies.effects.variants import tables_of
from lapwing.views.studies import accuracy_plot
from lapwing.views.terminal import table

GOAL = 1e-6  # error of the first line without another one
STRICTER = 0.1  # ratio of the smaller error whose cost the first line has


class Study(NamedTuple):
    """Result of `lapwing accuracy` for a system or a scene."""

    target: str
    problem: Problem
    points: list[Point]
    goal: float  # error for which a solver is selected
    selected: Point | None  # meets the goal with the fewest evaluations, in a scene's flight; None if none does
    parts: list[ErrorSource]  # error sources of a scene's flight
    largest: ErrorSource | None  # the largest of them with the scene's communication
    rounding: RoundOff | None  # None for a problem without steps in extended precision
    cost: tuple[float, float] | None  # [ns] of a plant step of a scene with contact: hovering, on the ground


def study(
    target: str,
    overrides: list[str],
    goal: float | None,
    progress: Callable[[str, int, int], None] = lambda text, done, total: None,
) -> Study:
    """Study one target.

    Args:
        target: name of a problem, or path of a scene.
        overrides: "key=value" of the scene.
        goal: error for which a solver is selected; None: that of the scene, or `GOAL`.
        progress: called with the current part, and the numbers of finished and of all parts.

    Raises:
        ValueError: the target or goal is invalid, or no method meets a given goal.
    """
    check_target(goal)
    scene = scene_of(target, overrides)
    problem = scenes.problem(scene.each_vehicle[0]) if scene else find(target)
    compiled, methods = statistics().compiled, len(problem.methods)

    def say(name: str, done: int = methods) -> None:
        once = "compiling (once) and " if statistics().compiled > compiled else ""
        progress(f"{once}measuring {name}", done, methods + 2)

    asked = goal or (scene and scene.each_vehicle[0][Solver].accuracy) or GOAL
    points = measure(problem, progress=say)
    selected, undecided = None, scene is not None and accuracy_to_select_for(scene) is not None
    with nullcontext() if goal or undecided else suppress(ConfigError):
        selected = _of_flight(scene, overrides, asked, points, say) if scene else cheapest(points, asked)
    if scene and selected and undecided:
        scene = load(scene.path, [*overrides, *solver_selection.as_overrides(selected.method, selected.setting)])
    say("error sources of the flight", methods)
    parts = error_budget.errors(scene) if scene else []
    cost = costs(scene, [tables_of(scene)])[0][:2] if scene and error_budget.has_contact(scene) else None
    say("round-off", methods + 1)
    largest = error_budget.largest(scene, parts) if scene else None
    return Study(target, problem, points, asked, selected, parts, largest, round_off.measure(problem), cost)


def _of_flight(
    scene: Scene, overrides: list[str], accuracy: float, points: list[Point], say: Callable[[str], None]
) -> Point:
    """Return the point that `solver.accuracy` selects for a scene's flight; without error and time if not measured.

    Raises:
        SceneError: no integrator meets the accuracy.
    """
    flown = load(scene.path, [*overrides, f"solver={{accuracy={accuracy!r}}}"])
    method, step = solver_selection.select(flown, accuracy, lambda _: say("the flight with each integrator"))
    same = (p for p in points if p.method == method and math.isclose(p.setting, step))
    return next(same, Point(method, 0, "s", step, math.nan, math.nan, None, {}))


def show(screen: Console, study: Study) -> None:
    """Print the answer, the table of the points, and the error sources of a scene's flight."""
    screen.print(answer(study), highlight=False, soft_wrap=True)
    if part := study.largest:
        size = f"{part.position:.1e} m" if part.position else f"{part.attitude:.1e} rad"
        text = f"the flight errs most by its {part.source} ({part.label}): {size}; its error sources are listed below"
        screen.print(text, highlight=False, soft_wrap=True)
    show_points(screen, study.problem, study.points, study.rounding)
    if study.parts:
        show_error_sources(screen, study.parts, study.cost)


def write_json(path: Path, study: Study) -> None:
    """Write all points, and for a scene its error sources and the cost [ns] of a plant step."""
    data = {
        "target": study.target,
        "title": study.problem.title,
        "duration": study.problem.duration,
        "time_unit": study.problem.unit,
        "reference": study.problem.source,
        "points": study.points,
        "target_error": study.goal,
        "cheapest": study.selected,
        "round_off": study.rounding,
        "error_sources": study.parts,
        "step_ns": dict(zip(("hovering", "in contact"), study.cost, strict=True)) if study.cost else None,
    }
    json_file.write_json(path, data)


def plot(path: Path, study: Study) -> None:
    """Plot error over CPU time."""
    accuracy_plot.draw(path, study.problem.title, study.points, study.parts, study.goal, study.selected)


LEVELS = [10.0**-k for k in range(2, 11, 2)]  # errors for which the cheapest points are printed


def setting(point: Point, unit: str) -> str:
    """Format the step or tolerance of a point."""
    if point.unit == "tol":
        return f"tol {point.setting:.0e}"
    return f"{1e3 * point.setting:.3g} ms" if unit == "s" and point.setting < 1.0 else f"{point.setting:.3g} {unit}"


def answer(study: Study) -> str:
    """Return the solver for the goal with its cost, and for a problem the price of a stricter goal, as one line."""
    problem, point = study.problem, study.selected
    if point is None:
        return f"{study.goal:g}: no method meets this error{smallest_error(study.points)}"
    cost = f"{1e3 * point.time:.3g} ms of CPU time for {problem.duration:g} {problem.unit}"
    if study.parts:
        cost = "" if math.isnan(point.time) else f" ({cost} in the air)"
        return (
            f"{study.goal:g}: {point.method} at {setting(point, 's')} in the flight, as solver.accuracy selects{cost}"
        )
    if point.evaluations is not None:
        cost += f", {point.evaluations} evaluations, the fewest"
    finer = [p for p in study.points if p.error <= STRICTER * study.goal]
    if not finer:
        price = "no method is ten times more accurate"
    elif point.evaluations is None:
        price = _price(cheapest(finer, study.goal).time / point.time)
    else:
        price = _price(cheapest(finer, study.goal).work[0] / point.evaluations)
    solver = f"{point.method} at {setting(point, problem.unit)}"
    fast = min((p for p in study.points if p.error <= study.goal), key=lambda p: p.time)
    if fast.spread[1] < point.spread[0]:
        less = f"{100.0 * (1.0 - fast.time / point.time):.0f} % less time"
        cost += f"; {fast.method} at {setting(fast, problem.unit)} took {less}"
    return f"{study.goal:g}: {solver} (error {point.error:.1e}), {cost}; {price}"


def _price(ratio: float) -> str:
    text = f"{ratio:.2g}"
    return f"ten times more accurate costs {'no more' if float(text) <= 1.0 else f'{text} times as much'}"


def show_points(console: Console, problem: Problem, points: list[Point], rounding: RoundOff | None = None) -> None:
    """Print the cheapest points of each method at a few errors, and the round-off error."""
    title = f"{problem.title}, {problem.duration:g} {problem.unit}"
    console.print(f"{title}; errors at its end, relative to 1 + size; reference: {problem.source}", highlight=False)
    drifts = ["drift of\n" + name.replace(" ", "\n") for name in _drifts(points)]
    heads = ("method (order)\n    step", "error", "CPU\n[ms]", "evaluations", *drifts)
    rows = table(*heads, box=None, pad_edge=False, collapse_padding=True)
    previous = None
    for point in pareto_points(points, LEVELS):
        if point.method != previous:
            rows.add_row(f"{point.method} ({point.order})")
        rows.add_row(
            f"    {setting(point, problem.unit)}", f"{point.error:.1e}", f"{1e3 * point.time:.3g}",
            "" if point.evaluations is None else str(point.evaluations),
            *(f"{point.drift[n]:.0e}" for n in _drifts(points)),
        )  # fmt: skip
        previous = point.method
    console.print(rows)
    if rounding is not None:
        text = (
            f"round-off: {rounding.error:.1e}, against {rounding.steps} equal steps of {rounding.method} "
            "in extended precision"
        )
        console.print(text, highlight=False)


def _drifts(points: list[Point]) -> list[str]:
    return list(points[0].drift) if points else []


def show_error_sources(console: Console, parts: list[ErrorSource], cost: tuple[float, float] | None) -> None:
    """Print the error sources of a flight, and the cost of a plant step [ns]: hovering, on the ground."""
    console.print("Error sources of the flight, in closed loop without noise (90th percentile over the ticks):")
    heads = ("source", "setting", "position (m)", "attitude (rad)", "largest (m)")
    rows = table(*heads, box=SIMPLE, pad_edge=False)
    rows.columns[1].justify = "left"
    previous = None
    for part in parts:
        source = part.source if part.source != previous else ""
        errors = (part.position, part.attitude, part.largest_position)
        rows.add_row(source, part.label, *(f"{error:.1e}" for error in errors))
        previous = part.source
    console.print(rows)
    if cost:
        air, ground = cost
        console.print(f"A plant step takes {air:.0f} ns hovering, {ground:.0f} ns in contact.", highlight=False)
