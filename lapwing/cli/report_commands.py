"""Reports, views and videos of logs, and the local page `lapwing studio`."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from lapwing.cli.app import app
from lapwing.cli.options import LogFile


@app.command()
def report(
    log: LogFile,
    other: Annotated[
        Path | None, typer.Argument(metavar="[FILE]", help="second log, drawn over the first in every plot")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.html|pdf|png", help="report [.html next to the first log]")
    ] = None,
    vehicle: Annotated[str | None, typer.Option(metavar="NAME", help="vehicle to report [first in the log]")] = None,
    names: Annotated[
        str | None, typer.Option(metavar="NAME,NAME", help="names of the two flights [those of the logs]")
    ] = None,
) -> None:
    """Write a report of a log, or a comparison of two logs."""
    from lapwing.api.flight import Flight
    from lapwing.cli.output_paths import check_distinct, claim_report
    from lapwing.flights.flight_data import SHOWN

    check_distinct({"FILE": log, "the second FILE": other, "--out": out})
    claim_report("--out", out or log.with_suffix(".html"))
    labels = _names(names, other)
    second = Flight.read(other, vehicle, SHOWN) if other else None
    flight = Flight.read(log, vehicle, SHOWN)
    for each, name in zip((flight, second), labels, strict=False):
        if each is not None:
            each.name = name
    typer.echo(flight.report(out, second))


@app.command()
def view(
    log: LogFile,
    rerun: Annotated[
        bool, typer.Option("--rerun", help="open the log in Rerun instead; needs pip install lapwing[view]")
    ] = False,
) -> None:
    """Write the report of a log and open it in the browser."""
    import webbrowser

    from lapwing.api.flight import Flight
    from lapwing.flights.flight_data import SHOWN
    from lapwing.views.rerun_export import open_in_rerun

    if rerun:
        typer.echo(open_in_rerun(log))
        return
    page = Flight.read(log, only=SHOWN).report()
    if not webbrowser.open(page.resolve().as_uri()):
        typer.echo("no browser found; open this page:")
    typer.echo(page)


@app.command()
def render(
    log: LogFile,
    out: Annotated[Path, typer.Option(metavar="FILE.mp4|webp|gif|png", help="video or image to write")],
    other: Annotated[
        Path | None, typer.Option("--with", metavar="FILE", help="second log, drawn translucent in the same scene")
    ] = None,
    camera: Annotated[str, typer.Option(metavar="follow|orbit|top|onboard", help="camera position")] = "follow",
    size: Annotated[str, typer.Option(metavar="WIDTHxHEIGHT", help="size in pixels, even numbers")] = "960x540",
    start: Annotated[
        float | None, typer.Option("--from", metavar="S", help="start time; of an image, its time [middle]")
    ] = None,
    stop: Annotated[float | None, typer.Option("--to", metavar="S", help="end time of a video")] = None,
    fps: Annotated[float, typer.Option(metavar="N", help="frames per second of a video")] = 20.0,
    speed: Annotated[float, typer.Option(metavar="N", help="simulated seconds per second of a video")] = 1.0,
) -> None:
    """Write a video or an image of a log's 3D view.

    Needs chromium, and pip install lapwing[view3d].
    """
    from lapwing.api.flight import Flight
    from lapwing.cli.output_paths import check_distinct, claim
    from lapwing.cli.progress import step_progress
    from lapwing.flights.flight_data import SHOWN
    from lapwing.views.report.sections import labels
    from lapwing.views.terminal import console
    from lapwing.views.view3d.render import Shot, check
    from lapwing.views.view3d.render import render as draw

    shot = Shot(start, stop, fps, speed, camera, _size(size))
    check(out, shot)
    check_distinct({"FILE": log, "--with": other, "--out": out})
    flights = [Flight.read(path, only=SHOWN) for path in (log, other) if path]
    claim(out)
    with step_progress(console(), "pictures", parallel=1) as say:
        draw(flights, labels(flights), out, shot, partial(say, ""))
    typer.echo(out)


@app.command()
def studio(
    port: Annotated[int, typer.Option(metavar="N", min=0, max=65535, help="TCP port on 127.0.0.1; 0: any free")] = 0,
) -> None:
    """Pick, change, fly and compare scenes on a local web page.

    Serves on this machine only, until Ctrl-C. Needs pip install lapwing[studio].
    """
    from lapwing.views.studio.server import serve

    serve(port, typer.echo)


def _names(text: str | None, other: Path | None) -> list[str]:
    """Return the names of --names, empty without it."""
    if text is None:
        return []
    result = [name.strip() for name in text.split(",")]
    if other is None or len(result) != 2 or not all(result) or len(set(result)) != 2:
        raise ValueError(f"--names {text}: expected two different names for two logs, e.g. --names PID,Lee")
    return result


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise ValueError(f"--size {text}: expected WIDTHxHEIGHT, e.g. 1280x720")
    return int(width), int(height)
