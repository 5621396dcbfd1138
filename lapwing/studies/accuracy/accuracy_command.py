"""`lapwing accuracy`: study of a target, with printed, written and plotted results."""

import sys
import threading
from pathlib import Path
from typing import NamedTuple

from rich.console import Console

from lapwing.kernels import statistics
from lapwing.studies import json_file, terminal
from lapwing.studies.accuracy import console_output, error_budget, round_off, scenes
from lapwing.studies.accuracy import work_precision_plot as picture
from lapwing.studies.accuracy.error_budget import ErrorSource
from lapwing.studies.accuracy.problem import Problem
from lapwing.studies.accuracy.round_off import RoundOff
from lapwing.studies.accuracy.targets import find, scene_of
from lapwing.studies.accuracy.work_precision import Point, cheapest, check_target, measure
from lapwing.studies.effects.cost import costs
from lapwing.studies.effects.variants import tables_of

WIDTH = 120  # characters of a table without a terminal
SLOW = 3.0  # [s] after which the reason is printed


class Study(NamedTuple):
    """Result of `lapwing accuracy` for a system or a scene."""

    target: str
    problem: Problem
    points: list[Point]
    selected: Point | None  # cheapest point that meets the goal; None without a goal
    parts: list[ErrorSource]  # error sources of a scene's flight
    rounding: RoundOff | None  # None for a problem without steps in extended precision
    cost: tuple[float, float] | None  # [ns] of a plant step of a scene with contact: hovering, on the ground


def console() -> Console:
    """Return the console, of fixed width if the output is redirected."""
    return terminal.console(None if sys.stdout.isatty() else WIDTH)


def study(screen: Console, target: str, overrides: list[str], goal: float | None) -> Study:
    """Study one target.

    Args:
        screen: console for progress messages.
        target: name of a problem, or path of a scene.
        overrides: "key=value" of the scene.
        goal: error for which the cheapest solver is selected; None: no selection.

    Raises:
        ValueError: the target or goal is invalid, or no method meets the goal.
    """
    check_target(goal)
    scene = scene_of(target, overrides)
    problem = scenes.problem(scene) if scene else find(target)
    compiled = statistics().compiled

    def notify() -> None:
        screen.print("compiling, and measuring ..." if statistics().compiled > compiled else "measuring ...")

    notice = threading.Timer(SLOW, notify)
    notice.daemon = True
    notice.start()
    try:
        points = measure(problem)
        selected = None if goal is None else cheapest(points, goal)
        parts = error_budget.errors(scene) if scene else []
        cost = costs(scene, [tables_of(scene)])[0][:2] if scene and error_budget.has_contact(scene) else None
        return Study(target, problem, points, selected, parts, round_off.measure(problem), cost)
    finally:
        notice.cancel()


def show(screen: Console, study: Study) -> None:
    """Print the table of the points, and the error sources of a scene's flight."""
    console_output.show(screen, study.problem, study.points, study.selected, study.rounding)
    if study.parts:
        console_output.show_error_sources(screen, study.parts, study.cost)


def write_json(path: Path, study: Study) -> None:
    """Write all points, and for a scene its error sources and the cost [ns] of a plant step."""
    data = {
        "target": study.target,
        "title": study.problem.title,
        "duration": study.problem.duration,
        "time_unit": study.problem.unit,
        "reference": study.problem.source,
        "points": study.points,
        "cheapest": study.selected,
        "round_off": study.rounding,
        "error_sources": study.parts,
        "step_ns": dict(zip(("hovering", "in contact"), study.cost, strict=True)) if study.cost else None,
    }
    json_file.write_json(path, data)


def plot(path: Path, study: Study) -> None:
    """Plot error over wall time."""
    picture.draw(path, study.problem.title, study.points, study.parts)
