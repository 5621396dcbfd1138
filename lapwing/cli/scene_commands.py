"""Scenes listed, checked and precompiled; reports of logs; autopilot parameters."""

from pathlib import Path
from typing import Annotated, Any

import typer

from lapwing.cli.app import app
from lapwing.cli.error_exit import user_errors
from lapwing.cli.options import LogFile, Overrides, SceneFile
from lapwing.cli.preflight import warn_of_gains, with_solver_selected


@app.command()
def scenes(
    folder: Annotated[
        Path | None, typer.Argument(metavar="[FOLDER]", help="folder of scenes [the shipped scenes]")
    ] = None,
) -> None:
    """List scenes with their titles."""
    from lapwing.cosim.scene import SceneError
    from lapwing.services.common.run_schema import SHIPPED, title

    with user_errors():
        paths = sorted((folder or SHIPPED).glob("*.toml"))
        if not paths:
            raise ValueError(f"{folder}: no scenes there; expected a folder with .toml files")
        names = [str(path) if folder else path.stem for path in paths]
        width = max(map(len, names))
        for name, path in zip(names, paths, strict=True):
            try:
                line = title(path)
            except SceneError as error:
                line = f"(broken: {error})"
            typer.echo(f"{name:<{width}}  {line}")


@app.command()
def check(scene: SceneFile, set_: Overrides = None) -> None:
    """Validate a scene and show what it contains."""
    from lapwing.services.common.communication_schema import Communication
    from lapwing.services.common.run_schema import Run
    from lapwing.services.common.vehicle_schema import Vehicle
    from lapwing.services.scene_resolver import resolve

    with user_errors():
        loaded = with_solver_selected(scene, set_ or [])
        setup = resolve(loaded)
        exchange, lines = loaded[Communication], [("title", loaded[Run].title or loaded.name)]
        typer.echo(f"{scene}: ok")
        warn_of_gains(loaded)
        for each in loaded.vehicles or (loaded,):
            vehicle = each[Vehicle]
            lines += [
                ("vehicle", f"{vehicle.name}, {vehicle.airframe or vehicle.model}"),
                ("effects", ", ".join(sorted(each.tables("effects"))) or "none"),
                ("sensors", ", ".join(sorted(each.tables("sensors"))) or "none"),
            ]
        lines.append(("services", f"{', '.join(setup.order)}; {exchange.rate} Hz, {exchange.coupling}"))
        for label, line in lines:
            typer.echo(f"  {label:<9} {line}")


@app.command()
def precompile(
    scenes: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[SCENE|FOLDER]...", help="scenes, or folders of scenes [delivery_mission]"),
    ] = None,
) -> None:
    """Compile the kernels of scenes ahead of their first run.

    Invalid scenes are reported and skipped.
    """
    from lapwing.runs.precompile import compile_ahead
    from lapwing.services.scene_resolver import resolve
    from lapwing.studies.terminal import console

    with user_errors():
        paths = [each for given in scenes or [Path("delivery_mission")] for each in _scenes_of(given)]
        sound: dict[str, Any] = {}
        faults: list[ValueError] = []
        for path in paths:
            try:
                sound[str(path)] = resolve(with_solver_selected(path, []))
            except ValueError as fault:
                faults.append(fault)
        compile_ahead(sound, console())
        for other in faults[:-1]:
            typer.echo(f"lapwing: {other}", err=True)
        if faults:
            raise faults[-1]


def _scenes_of(path: Path) -> list[Path]:
    """Return a scene, or all scenes of a folder."""
    if not path.is_dir():
        return [path]
    found = sorted(path.glob("*.toml"))
    if not found:
        raise ValueError(f"{path}: no scenes there; expected a folder with .toml files")
    return found


@app.command()
def report(
    log: LogFile,
    other: Annotated[
        Path | None, typer.Argument(metavar="[FILE]", help="second log, drawn over the first in every plot")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.html|pdf|png", help="report [beside the first log, .html]")
    ] = None,
    vehicle: Annotated[str | None, typer.Option(metavar="NAME", help="vehicle to report [first in the log]")] = None,
) -> None:
    """Write a report of a log, or a comparison of two logs."""
    from lapwing.cli.output_paths import check_distinct, claim_report
    from lapwing.flight import Flight
    from lapwing.studies.flight_data import SHOWN

    with user_errors():
        check_distinct({"FILE": log, "the second FILE": other, "--out": out})
        claim_report("--out", out or log.with_suffix(".html"))
        beside = Flight.read(other, vehicle, SHOWN) if other else None
        typer.echo(Flight.read(log, vehicle, SHOWN).report(out, beside))


@app.command()
def view(
    log: LogFile,
    rerun: Annotated[
        bool, typer.Option("--rerun", help="open the log in Rerun instead; needs pip install lapwing[view]")
    ] = False,
) -> None:
    """Write the report of a log and open it in the browser."""
    import webbrowser

    from lapwing.flight import Flight
    from lapwing.rerun import open_in_rerun
    from lapwing.studies.flight_data import SHOWN

    with user_errors():
        if rerun:
            open_in_rerun(log)
            return
        page = Flight.read(log, only=SHOWN).report()
        if not webbrowser.open(page.resolve().as_uri()):
            typer.echo("no browser found; open this page:")
        typer.echo(page)


@app.command()
def parameters(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="scene, or MCAP log of a run")],
    save: Annotated[
        Path | None, typer.Option(metavar="FILE", help="write a QGroundControl parameter file, which a scene can use")
    ] = None,
) -> None:
    """List the autopilot parameters of a scene or at the end of a log."""
    from lapwing.cosim.log import LogReader
    from lapwing.runs.resimulate import given_commands, recorded_setup
    from lapwing.services.common import parameter_file
    from lapwing.services.common.autopilot_parameters import changed
    from lapwing.services.scene_resolver import resolve

    with user_errors():
        commands: list = []
        if file.suffix == ".toml":
            setup = resolve(with_solver_selected(file, []))
        else:
            with LogReader(file) as read:
                setup = recorded_setup(read)
                commands = [command for _, given in given_commands(read, setup) for command in given]
        if not setup.vehicle:
            raise ValueError(f"{file}: has {len(setup.vehicles)} vehicles; expected a scene or log with one vehicle")
        if "autopilot" not in setup.services:
            raise ValueError(f"{file}: no autopilot; expected a scene with [autopilot], or its log")
        known = {p.name: p for p in setup.services["autopilot"].parameters.parameters}
        values = changed(known, commands)
        if save:
            parameter_file.write(save, known.values(), values)
        for p in known.values():
            typer.echo(f"{p.name:<16} {values[p.name]:<12.6g} {p.unit:<6} {p.least:g} to {p.most:g}: {p.meaning}")
