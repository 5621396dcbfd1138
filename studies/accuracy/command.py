"""`lapwing accuracy`: measure, print, and write what was asked for."""

import sys
import threading
from pathlib import Path

from rich.console import Console

from studies.accuracy import apart, scenes, table
from studies.accuracy import plot as picture
from studies.accuracy.measure import cheapest, check_target, measure
from studies.accuracy.targets import find, scene_of

WIDTH = 120  # letters of a table that goes to no terminal
SLOW = 3.0  # [s] after which the user is told why


def run(target: str, overrides: list[str], goal: float | None, json: Path | None, plot: Path | None) -> None:
    """Study one target.

    Args:
        target: name of a problem, or a scene's file.
        overrides: "key=value" of the scene.
        goal: error whose cheapest choice is named, None for no such choice.
        json: file for all points.
        plot: file for the picture.

    Raises:
        ValueError: no such target, no sound goal, or a goal that no method meets.
    """
    check_target(goal)
    scene = scene_of(target, overrides)
    problem = scenes.problem(scene) if scene else find(target)
    console = Console(width=None if sys.stdout.isatty() else WIDTH)
    notice = threading.Timer(SLOW, console.print, ["measuring (the first time each method is compiled) ..."])
    notice.daemon = True
    notice.start()
    try:
        points = measure(problem)
        chosen = None if goal is None else cheapest(points, goal)
        parts = apart.errors(scene) if scene else []
    finally:
        notice.cancel()
    table.show(console, problem, points, chosen)
    if parts:
        table.show_parts(console, parts)
    if json:
        table.write_json(json, target, problem, points, chosen, parts)
    if plot:
        picture.draw(plot, problem.title, points, parts)
