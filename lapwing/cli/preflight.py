"""Preparation of a scene: solver selection, success criteria, gain check."""

from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from lapwing.cosim.scene import Scene


def with_solver_selected(path: Path, overrides: list[str]) -> "Scene":
    """Load a scene; if it sets `solver.accuracy`, select integrator and step."""
    from lapwing.services.plant.schema import Solver
    from lapwing.services.scene_resolver import load
    from lapwing.studies.metrics import check_success

    scene = load(path, overrides)
    for vehicle in scene.vehicles or (scene,):
        check_success(vehicle)
    if scene.vehicles or not scene[Solver].undecided:  # each vehicle of several would select its own
        return scene
    from lapwing.studies.accuracy import solver_selection

    chosen = solver_selection.overrides(scene, typer.echo)
    typer.echo(f"solver.accuracy = {scene[Solver].accuracy:g}: chosen {', '.join(chosen)}")
    return load(path, [*overrides, *chosen])


def warn_of_gains(scene: "Scene") -> None:
    """Print a warning for each unstable control loop."""
    from lapwing.services.autopilot.stability_check import unstable_loops

    for vehicle in scene.vehicles or (scene,):
        of = f"{vehicle.lookup('vehicle.name')}: " if scene.vehicles else ""
        for line in unstable_loops(vehicle):
            typer.echo(f"lapwing: warning: {of}{line}", err=True)
