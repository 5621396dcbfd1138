"""Preparation of a scene: solver selection, success criteria, gain check, firmware executable."""

import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import typer

MANY_PARTS = 8  # of a step, from which the cause is printed
RIGID = ("rigid_body", "multibody")  # models of a multirotor without a load, which the wind moves by itself

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
    from lapwing.services.autopilot.stability_check import unstable_loops

    lines = []
    for vehicle in scene.each_vehicle:
        lines += [f"{_prefix(scene, vehicle)}{line}" for line in unstable_loops(vehicle)]
    for line in lines:
        typer.echo(f"lapwing: {'warning: ' if force else ''}{line}", err=True)
    if lines and not force:
        raise ValueError("autopilot.gains: unstable in hover; design others with lapwing tune, or use --force")


def _prefix(scene: "Scene", vehicle: "Scene") -> str:
    """Return the name of a vehicle of a fleet, for the beginning of a line; "" for one vehicle."""
    return f"{vehicle.lookup('vehicle.name')}: " if scene.vehicles else ""


def print_warnings(scene: "Scene", config: "RunConfig") -> None:
    """Print a line for each part of a scene that can be flown but hardly does what its author expects."""
    _warn_of_round_off(scene)
    _warn_of_split_steps(scene)
    _warn_of_wind(scene)
    _warn_of_fence(scene, config)


def _warn_of_round_off(scene: "Scene") -> None:
    """Print a warning for each vehicle whose substeps in contact reach round-off before its accuracy."""
    from lapwing.services.plant.schema import Solver, limited_by_round_off

    for vehicle in scene.each_vehicle:
        if limit := limited_by_round_off(vehicle):
            (name, least), accuracy = limit, vehicle[Solver].accuracy
            message = f"substeps of {name} are limited by round-off, and {accuracy:g} may be missed in contact"
            typer.echo(f"lapwing: warning: solver.accuracy: {message}; use at least {least:g}", err=True)


def _warn_of_split_steps(scene: "Scene") -> None:
    """Print a warning for each vehicle whose steps are split into many parts, with the cause."""
    from lapwing.dynamics.vehicles.step_bound import FASTEST_RATE, causes
    from lapwing.services.common.schemas.vehicle_schema import Vehicle
    from lapwing.services.plant import models
    from lapwing.services.plant.schema import method

    for vehicle in scene.each_vehicle:
        model = models.get(vehicle[Vehicle].model)
        if not hasattr(model, "describe"):
            continue
        formulation, p = model.describe(vehicle)
        fastest, step = causes(p, formulation.initial_state(p).memory)[0], method(vehicle)[2]
        if (number := fastest.rate * step / FASTEST_RATE) > MANY_PARTS:
            message = f"{fastest.name} (decay within {1e3 / fastest.rate:.2g} ms) split each step of {1e3 * step:g} ms"
            typer.echo(f"lapwing: warning: solver: {message} into {number:.0f}, which costs most of the time", err=True)


def _warn_of_wind(scene: "Scene") -> None:
    """Print a warning for each vehicle whose scene has a wind that moves nothing."""
    from lapwing.dynamics.effects._wind_use import uses_wind
    from lapwing.services.common.schemas.vehicle_schema import Effects, Vehicle
    from lapwing.services.plant import models

    for vehicle in scene.each_vehicle:
        winds = [name for name in vehicle[Effects].tables if name.startswith("wind_")]
        if not winds or vehicle[Vehicle].model not in RIGID or "shared_slung_load" in vehicle[Effects].tables:
            continue
        if not any(uses_wind(effect) for effect in models.get(vehicle[Vehicle].model).describe(vehicle)[1].effects):
            wind = f"{_prefix(scene, vehicle)}effects.{winds[0]}"
            message = "does not move the vehicle: no effect of the scene uses it; add body_drag or axial_inflow"
            typer.echo(f"lapwing: warning: {wind} {message}", err=True)


def _warn_of_fence(scene: "Scene", config: "RunConfig") -> None:
    """Print a warning for each vehicle whose trajectory leaves the scene's fence, with the first time and place."""
    from lapwing.cosim.diagram.multi_vehicle import members
    from lapwing.services.common.plans.fence import Fence
    from lapwing.services.common.schemas.fence_schema import FenceTable
    from lapwing.services.trajectory.service import NAME, TrajectoryConfig

    for vehicle, member in zip(scene.each_vehicle, members(config), strict=True):
        service = member.services.get(NAME)
        if not vehicle.has(FenceTable) or service is None or not isinstance(service.parameters, TrajectoryConfig):
            continue
        fence = Fence(vehicle[FenceTable].items())
        for time, phase, x, y, _ in service.parameters.track(member.duration):
            if breach := fence.breach(x, y):
                place = f"x = {x:z.1f} m, y = {y:z.1f} m at t = {time:.1f} s in phase {phase!r}"
                message = f"{_prefix(scene, vehicle)}trajectory: {place} is {breach}"
                typer.echo(f"lapwing: warning: {message}; move it or the fence", err=True)
                break


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
