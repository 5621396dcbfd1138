"""What there is to fly, whether it is valid, what it is tuned to, what a log shows; and kernels compiled ahead."""

from pathlib import Path
from typing import Annotated

import typer

from services.commands.app import app
from services.commands.choice import decided, warn_of_gains
from services.commands.errors import user_errors
from services.commands.options import (
    Overrides,
    SceneFile,
)


@app.command()
def scenes(folder: Annotated[Path, typer.Argument(help="where to look")] = Path("scenes")) -> None:
    """List the scenes, a line each."""
    from services.scene import SceneError, load
    from services.sections import Run

    with user_errors():
        paths = sorted(folder.glob("*.toml"))
        if not paths:
            raise ValueError(f"{folder}: no scenes there; expected a folder with .toml files")
        width = max(len(str(path)) for path in paths)
        for path in paths:
            try:
                line = load(path)[Run].title
            except SceneError as error:
                line = f"(broken: {error})"
            typer.echo(f"{path!s:<{width}}  {line}")


@app.command()
def check(scene: SceneFile, set_: Overrides = None) -> None:
    """Validate a scene."""
    from services.sections import Exchange, Run, Vehicle
    from services.table import lockstep_services

    with user_errors():
        loaded, _ = decided(scene, set_ or [])
        vehicle, exchange = loaded[Vehicle], loaded[Exchange]
        typer.echo(f"{scene}: ok")
        warn_of_gains(loaded)
        for label, line in {
            "title": loaded[Run].title or loaded.name,
            "vehicle": f"{vehicle.name}, {vehicle.airframe}",
            "effects": ", ".join(sorted(loaded.tables("effects"))) or "none",
            "sensors": ", ".join(sorted(loaded.tables("sensors"))) or "none",
            "services": f"{', '.join(lockstep_services(loaded))}; {exchange.rate} Hz, {exchange.coupling}",
        }.items():
            typer.echo(f"  {label:<9} {line}")


@app.command()
def warm(
    scenes: Annotated[
        list[Path] | None, typer.Argument(metavar="[SCENE]...", help="[scenes/delivery_mission.toml]")
    ] = None,
) -> None:
    """Compile what scenes need, so that their first run starts at once."""
    import time

    from services import flight

    with user_errors():
        for path in scenes or [Path("scenes/delivery_mission.toml")]:
            started = time.perf_counter()
            flight.prepare(decided(path, [])[0], typer.echo)
            typer.echo(f"{path}: ready after {time.perf_counter() - started:.1f} s")


@app.command()
def report(log: Annotated[Path, typer.Argument(metavar="FILE", help="an MCAP log of a run")]) -> None:
    """Write an HTML report with plots beside a log."""
    from studies import report as study

    with user_errors():
        typer.echo(study.write(log))


@app.command()
def parameters(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="a scene, or an MCAP log of a run")],
    save: Annotated[
        Path | None, typer.Option(metavar="FILE", help="write them as QGroundControl does; a scene can name the file")
    ] = None,
) -> None:
    """List the autopilot's parameters: those of a scene, or those that a run ended with."""
    from services import parameter_file
    from services.log import LogReader
    from services.parameters import changed, table
    from services.refly import flown_scene, given_commands
    from services.scene import sections

    with user_errors():
        commands: list = []
        if file.suffix == ".toml":
            scene, _ = decided(file, [])
        else:
            with LogReader(file) as read:
                scene = flown_scene(read)
                commands = [command for _, given in given_commands(read, scene) for command in given]
        if not scene.has(sections()["autopilot"]):
            raise ValueError(f"{file}: nobody steers there; expected a scene with [autopilot], or a log of one")
        known = table(scene)
        values = changed(known, commands)
        if save:
            parameter_file.write(save, known.values(), values)
        for p in known.values():
            typer.echo(f"{p.name:<16} {values[p.name]:<12.6g} {p.unit:<6} {p.least:g} to {p.most:g}: {p.meaning}")
