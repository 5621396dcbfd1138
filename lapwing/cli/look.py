"""What there is to fly, whether it is valid, what it is tuned to, what a log shows; and kernels compiled ahead."""

from pathlib import Path
from typing import Annotated

import typer

from lapwing.cli.app import app
from lapwing.cli.choice import decided, warn_of_gains
from lapwing.cli.errors import user_errors
from lapwing.cli.options import (
    Overrides,
    SceneFile,
)


@app.command()
def scenes(
    folder: Annotated[Path | None, typer.Argument(help="where to look [the scenes that ship]")] = None,
) -> None:
    """List the scenes, a line each."""
    from cosim.scene import SceneError
    from services.common.sections import SHIPPED, Run
    from services.table import load

    with user_errors():
        paths = sorted((folder or SHIPPED).glob("*.toml"))
        if not paths:
            raise ValueError(f"{folder}: no scenes there; expected a folder with .toml files")
        names = [str(path) if folder else path.stem for path in paths]
        width = max(map(len, names))
        for name, path in zip(names, paths, strict=True):
            try:
                line = load(path)[Run].title
            except SceneError as error:
                line = f"(broken: {error})"
            typer.echo(f"{name:<{width}}  {line}")


@app.command()
def check(scene: SceneFile, set_: Overrides = None) -> None:
    """Validate a scene."""
    from services.common.exchange import Exchange
    from services.common.sections import Run
    from services.common.vehicle import Vehicle
    from services.table import resolve

    with user_errors():
        loaded = decided(scene, set_ or [])
        setup = resolve(loaded)
        vehicle, exchange = loaded[Vehicle], loaded[Exchange]
        typer.echo(f"{scene}: ok")
        warn_of_gains(loaded)
        for label, line in {
            "title": loaded[Run].title or loaded.name,
            "vehicle": f"{vehicle.name}, {vehicle.airframe or vehicle.model}",
            "effects": ", ".join(sorted(loaded.tables("effects"))) or "none",
            "sensors": ", ".join(sorted(loaded.tables("sensors"))) or "none",
            "services": f"{', '.join(setup.order)}; {exchange.rate} Hz, {exchange.coupling}",
        }.items():
            typer.echo(f"  {label:<9} {line}")


@app.command()
def warm(
    scenes: Annotated[list[Path] | None, typer.Argument(metavar="[SCENE]...", help="[delivery_mission]")] = None,
) -> None:
    """Compile what scenes need, so that their first run starts at once."""
    import time

    from cosim.graph import Graph
    from cosim.single import PAGE
    from services.processes import create_all
    from services.table import resolve

    with user_errors():
        for path in scenes or [Path("delivery_mission")]:
            started = time.perf_counter()
            setup = resolve(decided(path, []))
            Graph(setup, create_all(setup), PAGE)
            typer.echo(f"{path}: ready after {time.perf_counter() - started:.1f} s")


@app.command()
def report(
    log: Annotated[Path, typer.Argument(metavar="FILE", help="an MCAP log of a run")],
    other: Annotated[
        Path | None, typer.Argument(metavar="[FILE]", help="another one, laid over the first in every plot")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.html|pdf|png", help="where to write it [beside the first log, .html]")
    ] = None,
) -> None:
    """Write a report of a log, or of two laid over each other: a page for a browser, or plots on paper."""
    from lapwing.cli.files import check_distinct, check_report
    from lapwing.flight import Flight

    with user_errors():
        check_distinct({"FILE": log, "the second FILE": other, "--out": out})
        check_report("--out", out)
        typer.echo(Flight.read(log).report(out, Flight.read(other) if other else None))


@app.command()
def parameters(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="a scene, or an MCAP log of a run")],
    save: Annotated[
        Path | None, typer.Option(metavar="FILE", help="write them as QGroundControl does; a scene can name the file")
    ] = None,
) -> None:
    """List the autopilot's parameters: those of a scene, or those that a run ended with."""
    from cosim.log import LogReader
    from lapwing.runs.refly import given_commands, recorded_setup
    from services.common import parameter_file
    from services.common.parameters import changed
    from services.table import resolve

    with user_errors():
        commands: list = []
        if file.suffix == ".toml":
            setup = resolve(decided(file, []))
        else:
            with LogReader(file) as read:
                setup = recorded_setup(read)
                commands = [command for _, given in given_commands(read, setup) for command in given]
        if "autopilot" not in setup.services:
            raise ValueError(f"{file}: nobody steers there; expected a scene with [autopilot], or a log of one")
        known = {p.name: p for p in setup.services["autopilot"].parameters.parameters}
        values = changed(known, commands)
        if save:
            parameter_file.write(save, known.values(), values)
        for p in known.values():
            typer.echo(f"{p.name:<16} {values[p.name]:<12.6g} {p.unit:<6} {p.least:g} to {p.most:g}: {p.meaning}")
