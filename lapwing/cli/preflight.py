"""Preparation of a scene: solver selection, success criteria, gain check, firmware executable."""

import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from lapwing.cosim.config.run_config import RunConfig
    from lapwing.cosim.scene import Scene


def with_solver_selected(path: Path, overrides: list[str]) -> "Scene":
    """Load a scene; if it sets `solver.accuracy`, select integrator and step."""
    from lapwing.flights.metrics import check_success
    from lapwing.services.plant.schema import accuracy_to_select_for
    from lapwing.services.scene_resolver import load

    scene = load(path, overrides)
    for vehicle in scene.each_vehicle:
        check_success(vehicle)
    accuracy = accuracy_to_select_for(scene)
    if accuracy is None:
        return scene
    from lapwing.studies.accuracy import solver_selection

    chosen = solver_selection.overrides(scene, typer.echo)
    typer.echo(f"solver.accuracy = {accuracy:g}: selected {', '.join(chosen)}")
    return load(path, [*overrides, *chosen])


def check_gains(scene: "Scene", force: bool) -> None:
    """Print a line for each axis of each vehicle whose gains make a control loop unstable in hover.

    Raises:
        ValueError: there is such an axis; with `force`, the lines are warnings.
    """
    from lapwing.runs.scene_warnings import prefix
    from lapwing.services.autopilot.stability_check import unstable_loops

    lines = []
    for vehicle in scene.each_vehicle:
        lines += [f"{prefix(scene, vehicle)}{line}" for line in unstable_loops(vehicle)]
    for line in lines:
        typer.echo(f"lapwing: {'warning: ' if force else ''}{line}", err=True)
    if lines and not force:
        raise ValueError("autopilot.gains: unstable in hover; design others with lapwing tune, or use --force")


def print_warnings(scene: "Scene", config: "RunConfig") -> None:
    """Print a line for each part of a scene that can be flown but hardly does what its author expects."""
    from lapwing.runs.scene_warnings import warnings

    for line in warnings(scene, config):
        typer.echo(f"lapwing: warning: {line}", err=True)


def check_firmware_program(scene: "Scene") -> None:
    """Raise ConfigError if `autopilot.command` or `autopilot.directory` names no program or folder on this machine."""
    from lapwing.dynamics.config_error import ConfigError
    from lapwing.services.common.firmware.schema import TABLE, flown_by_firmware

    for vehicle in filter(flown_by_firmware, scene.each_vehicle):
        keys = vehicle.section(TABLE)
        folder = Path(keys.directory or ".")
        if not folder.is_dir():
            raise ConfigError(f"{TABLE}.directory", f"no folder {folder}", "the working directory of the program")
        if keys.shell and not keys.command:
            raise ConfigError(f"{TABLE}.shell", "Lapwing does not start the firmware", f"{TABLE}.command, its program")
        if keys.command and not _is_program(folder, keys.command[0]):
            expected = "path of a program, or a name on the PATH"
            raise ConfigError(f"{TABLE}.command", f"cannot start {keys.command[0]}", expected)


def _is_program(folder: Path, name: str) -> bool:
    """Return True if a process in `folder` can start `name`; a name without a slash is looked up on the PATH."""
    return shutil.which(str(folder / name) if "/" in name else name) is not None
