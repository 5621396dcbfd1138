"""`lapwing feed`: play the sensors of a recorded flight into builds of a firmware."""

import shlex
from itertools import combinations
from pathlib import Path
from typing import Annotated

import typer

from lapwing.cli.app import app
from lapwing.cli.options import Overrides


@app.command()
def feed(
    flight: Annotated[Path, typer.Argument(metavar="FLIGHT", help="log of a flight that `lapwing import` reads")],
    firmware: Annotated[str, typer.Option(metavar="px4|ardupilot", help="firmware that gets the sensors")],
    command: Annotated[
        list[str] | None, typer.Option(metavar="TEXT", help="program and arguments of a build (repeatable)")
    ] = None,
    skip: Annotated[float, typer.Option(metavar="S", min=0.0, help="time until the filter has settled")] = 15.0,
    set_: Overrides = None,
) -> None:
    """Play a recorded flight into a firmware and compare estimates.

    With several builds, also compare their estimates with each other.
    """
    from lapwing.flights.log_import.open_flight import open_flight
    from lapwing.studies import feed as study

    recording = open_flight(flight)
    builds = [shlex.split(text) for text in command or [""]]
    estimates = [study.recorded(recording)]
    for number, build in enumerate(builds, 1):
        found = study.feed(recording, firmware, build, set_ or [])
        typer.echo(f"build {number}: {found.report}, digest {found.digest}")
        estimates.append(found._replace(name=f"build {number}"))
    typer.echo("differences, root mean square and greatest; of the position without the mean")
    for first, second in combinations(estimates, 2):
        rows = study.difference(first, second, skip)
        parts = [f"{rms:.3g} {unit} (at most {most:.3g})" for unit, rms, most in rows]
        typer.echo(f"{first.name} and {second.name}: {', '.join(parts)}")
