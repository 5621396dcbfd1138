"""Scenes listed, checked and precompiled; autopilot parameters; schemas for editors."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from lapwing.cli.app import app
from lapwing.cli.options import Overrides
from lapwing.cli.output_paths import check_distinct, claim
from lapwing.cli.preflight import check_gains, print_warnings, with_solver_selected
from lapwing.cosim.complete_file import write_text
from lapwing.dynamics.config_error import ConfigError

if TYPE_CHECKING:
    from lapwing.cosim.config.run_config import RunConfig
    from lapwing.studies.accuracy.flight_accuracy import FlightAccuracy

T = TypeVar("T")


@app.command()
def scenes(
    folder: Annotated[
        Path | None, typer.Argument(metavar="[FOLDER]", help="folder of scenes [the shipped scenes]")
    ] = None,
) -> None:
    """List scenes with their titles."""
    from lapwing.cosim.scene import SceneError
    from lapwing.services.common.schemas.run_schema import SHIPPED, title

    paths = sorted((folder or SHIPPED).glob("*.toml"))
    if not paths:
        raise ValueError(f"{folder}: contains no scenes; expected a folder with .toml files")
    names = [str(path) if folder else path.stem for path in paths]
    width = max(map(len, names))
    for name, path in zip(names, paths, strict=True):
        try:
            line = title(path)
        except SceneError as error:
            line = f"(broken: {error})"
        typer.echo(f"{name:<{width}}  {line}")


@app.command()
def check(
    scene: Annotated[
        Path, typer.Argument(metavar="SCENE", help="scene file (TOML), or name; with --accuracy also a log (MCAP)")
    ],
    accuracy: Annotated[
        bool, typer.Option("--accuracy", help="fly it, and compare the error with solver.accuracy")
    ] = False,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write the errors of --accuracy as JSON")] = None,
    allow_code: Annotated[
        bool, typer.Option("--allow-code", help="allow FMUs, and Python modules of a log, to run for --accuracy")
    ] = False,
    set_: Overrides = None,
) -> None:
    """Validate a scene and show what it contains.

    With --accuracy the exit code is 1 if the error of the solver is larger than solver.accuracy.
    """
    from lapwing.cosim.diagram.multi_vehicle import members
    from lapwing.services.common import foreign_code
    from lapwing.services.common.schemas.communication_schema import Communication
    from lapwing.services.common.schemas.run_schema import Run
    from lapwing.services.common.schemas.vehicle_schema import Vehicle
    from lapwing.services.scene_resolver import resolve
    from lapwing.services.trajectory.service import ordered_path

    with foreign_code.permission(allow_code):
        if json and not accuracy:
            raise ValueError("--json: needs the errors of a flight; use it with --accuracy")
        claim(json)
        if scene.suffix == ".mcap":
            if not _accuracy_met(_accuracy_of_log(scene, accuracy, set_ or [], allow_code), json):
                raise SystemExit(1)
            return
        loaded = with_solver_selected(scene, set_ or [])
        config = resolve(loaded)
        exchange, lines = loaded[Communication], [("title", loaded[Run].title or loaded.name)]
        typer.echo(f"{scene}: ok")
        check_gains(loaded, force=True)
        print_warnings(loaded, config)
        for each, member in zip(loaded.each_vehicle, members(config), strict=True):
            vehicle = each[Vehicle]
            lines += [
                ("vehicle", f"{vehicle.name}, {vehicle.airframe or vehicle.model}"),
                ("effects", ", ".join(sorted(each.tables("effects"))) or "none"),
                ("sensors", ", ".join(sorted(each.tables("sensors"))) or "none"),
            ]
            if trajectory := ordered_path(member):
                lines.append(("path", trajectory.extent(member.duration)))
        lines.append(("services", f"{', '.join(config.order)}; {exchange.rate} Hz, {exchange.coupling}"))
        for label, line in lines:
            typer.echo(f"  {label:<9} {line}")
        if accuracy:
            from lapwing.studies.accuracy import flight_accuracy

            result = flight_accuracy.measure(loaded, _with_bar, loaded.overrides != tuple(set_ or []))
            if not _accuracy_met(result, json):
                raise SystemExit(1)


def _accuracy_of_log(log: Path, accuracy: bool, overrides: list[str], allow_code: bool) -> "FlightAccuracy":
    """Return the error of the solver in a recorded run."""
    from lapwing.cosim.scene import with_values
    from lapwing.runs.resimulate import recorded_run
    from lapwing.studies.accuracy import flight_accuracy

    if not accuracy and log.exists():
        raise ValueError(f"{log}: is a log; use --accuracy to measure its solver, or lapwing info")
    values = with_values({}, overrides)
    limit = values.get("solver", {}).get("accuracy")
    if values not in ({}, {"solver": {"accuracy": limit}}):
        raise ValueError("--set: the solver of a log is the recorded one; only solver.accuracy can be set")
    if limit is not None and not (isinstance(limit, int | float) and limit > 0.0):
        raise ValueError(f"--set solver.accuracy: expected a number above 0, got {limit!r}")
    run = recorded_run(log, allow_code)
    inputs = {"operator": run.operators, "recorded": run.firmware}
    return flight_accuracy.measure_recorded(run.config._replace(last_tick=run.last), inputs, _with_bar, limit)


def _accuracy_met(result: "FlightAccuracy", json: Path | None) -> bool:
    """Print and write the error of a flight. Return True if it is at most `solver.accuracy`."""
    from lapwing.views.studies import flight_accuracy_console as flight_accuracy_output
    from lapwing.views.terminal import console

    if json:
        flight_accuracy_output.write_json(json, result)
    flight_accuracy_output.show(console(), result)
    return result.met


def _with_bar(config: "RunConfig", description: str, work: Callable[[Callable[[int], None]], T]) -> T:
    """Work on a run in this process, with a line that describes the run and a progress bar."""
    from lapwing.runs.observer import notify_on_compile
    from lapwing.runs.work_progress import WorkProgress

    duration = config.last_tick * config.interval
    typer.echo(f"flying up to {duration:g} s: {description}")
    with WorkProgress(config.scene, duration, "s") as bar, notify_on_compile(config, bar.compiling):

        def observe(tick: int) -> None:
            bar.show(tick * config.interval)

        return work(observe)


@app.command()
def precompile(
    scenes: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[SCENE|FOLDER]...", help="scenes, or folders of scenes [delivery_mission]"),
    ] = None,
) -> None:
    """Compile the kernels of scenes ahead of their first run.

    All cores compile. Invalid scenes are reported and skipped.
    """
    from lapwing.runs.precompile import compile_ahead
    from lapwing.services.scene_resolver import resolve
    from lapwing.studies.workers import cores, processes, run_here
    from lapwing.views.terminal import console

    paths = [each for items in scenes or [Path("delivery_mission")] for each in scenes_of(items)]
    sound: dict[str, Any] = {}
    faults: list[ValueError] = []
    for path in paths:
        try:
            sound[str(path)] = resolve(with_solver_selected(path, []))
        except ValueError as fault:
            faults.append(fault)
    compile_ahead(sound, console(), processes(cores()) if cores() > 1 else run_here)
    for other in faults[:-1]:
        typer.echo(f"lapwing: {other}", err=True)
    if faults:
        raise faults[-1]


def scenes_of(path: Path) -> list[Path]:
    """Return a scene, or all scenes of a folder."""
    if not path.is_dir():
        return [path]
    result = sorted(path.glob("*.toml"))
    if not result:
        raise ValueError(f"{path}: contains no scenes; expected a folder with .toml files")
    return result


@app.command()
def parameters(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="scene (name or TOML file), or MCAP log of a run")],
    save: Annotated[
        Path | None, typer.Option(metavar="FILE", help="write a QGroundControl parameter file, which a scene can use")
    ] = None,
) -> None:
    """List the autopilot parameters of a scene or at the end of a log."""
    from lapwing.cosim.log import LogReader
    from lapwing.runs.resimulate import recorded_commands, recorded_config
    from lapwing.services.autopilot import parameter_file
    from lapwing.services.common.autopilot_parameters import apply_commands
    from lapwing.services.scene_resolver import resolve

    check_distinct({"FILE": file, "--save": save})
    claim(save)
    commands: list = []
    if file.suffix != ".mcap":
        config = resolve(with_solver_selected(file, []))
    else:
        with LogReader(file) as read:
            config = recorded_config(read)
            commands = [command for _, items in recorded_commands(read, config) for command in items]
    if not config.vehicle:
        raise ValueError(f"{file}: has {len(config.vehicles)} vehicles; expected a scene or log with one vehicle")
    if "autopilot" not in config.services:
        raise ValueError(f"{file}: no autopilot; expected a scene with [autopilot], or its log")
    known = {p.name: p for p in config.services["autopilot"].parameters.parameters}
    values = apply_commands(known, commands)
    if save:
        parameter_file.write(save, known.values(), values)
    width = max((len(p.unit) for p in known.values()), default=0)
    for p in known.values():
        typer.echo(f"{p.name:<16} {values[p.name]:<12.6g} {p.unit:<{width}} {p.least:g} to {p.most:g}: {p.meaning}")


@app.command()
def schema(
    kind: Annotated[str, typer.Argument(metavar="KIND", help="kind of file: scene, airframe or gains")] = "scene",
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="output file [standard output]")] = None,
) -> None:
    """Write a JSON schema with which editors check TOML files."""
    import json

    from lapwing.file_schemas.json_schema import SCHEMAS

    if kind not in SCHEMAS:
        raise ConfigError.unknown("KIND", "kind of file", kind, SCHEMAS)
    text = json.dumps(SCHEMAS[kind](), indent=1) + "\n"
    if out is None:
        typer.echo(text, nl=False)
    else:
        claim(out)
        write_text(out, text)
