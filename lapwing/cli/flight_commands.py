"""Commands on real flights: validate, identify, import."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Annotated

import typer

from lapwing.cli.app import app
from lapwing.cli.error_exit import user_errors
from lapwing.cli.options import Overrides, SceneFile
from lapwing.cli.output_paths import check_distinct, check_log, claim

Flights = Annotated[
    list[Path],
    typer.Argument(metavar="FLIGHTS...", help="Lapwing logs (.mcap), ULogs (.ulg), or .csv and .csv.gz with --mapping"),
]
MappingName = Annotated[
    str | None, typer.Option("--mapping", metavar="NAME|FILE", help="columns of CSV files: nanobench, or a .toml file")
]
TrimForce = Annotated[float, typer.Option(metavar="S", min=0.0, help="memory of the force trim; 0: none")]
TrimTorque = Annotated[float, typer.Option(metavar="S", min=0.0, help="memory of the torque trim; 0: none")]
FORCE_MEMORY, TORQUE_MEMORY = 0.15, 3.0  # [s] as `start_states.USUAL_TRIM`, which takes time to import


@app.command()
def validate(
    scene: SceneFile,
    flights: Flights,
    mapping: MappingName = None,
    horizons: Annotated[str, typer.Option(metavar="N,N,...", help="samples after which to compare")] = "1,10,50",
    stride: Annotated[int, typer.Option(metavar="N", min=1, help="samples between the starts of two windows")] = 5,
    trim_force: TrimForce = FORCE_MEMORY,
    trim_torque: TrimTorque = TORQUE_MEMORY,
    set_: Overrides = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write all errors as JSON")] = None,
    report: Annotated[Path | None, typer.Option(metavar="FILE", help="write errors over the envelope (HTML)")] = None,
) -> None:
    """Measure how well a scene's plant predicts recorded flights."""
    from lapwing.studies.terminal import console
    from lapwing.studies.validation import console_output, procedure, report_page
    from lapwing.studies.validation.start_states import TrimMemory

    with user_errors():
        steps = _horizons(horizons)
        _check_flights(flights)
        check_distinct({"--json": json, "--report": report})
        if report and report.suffix != ".html":
            raise ValueError(f"--report {report}: expected a name that ends in .html")
        claim(json)
        claim(report)
        with _bar() as say:
            memory = TrimMemory(trim_force, trim_torque)
            found = procedure.validate(scene, flights, mapping, steps, set_ or [], memory, stride, say)
        console_output.show(console(), found)
        if json:
            procedure.write_json(json, found)
        if report:
            report_page.write(report, found)
            typer.echo(f"{report}: errors over the envelope and residual spectra")


@app.command()
def identify(
    scene: SceneFile,
    flights: Flights,
    free: Annotated[str, typer.Option(metavar="KEY,KEY,...", help="parameters to estimate: numbers of the scene")],
    out: Annotated[Path, typer.Option(metavar="FILE", help="the airframe file to write (.toml)")],
    mapping: MappingName = None,
    windows: Annotated[int, typer.Option(metavar="N", min=20, help="windows to fit, about")] = 1000,
    trim_force: TrimForce = FORCE_MEMORY,
    trim_torque: TrimTorque = TORQUE_MEMORY,
    seed: Annotated[int, typer.Option(metavar="N", help="seed of the choice of held-out flights")] = 1,
    set_: Overrides = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write estimates and correlations as JSON")] = None,
) -> None:
    """Estimate parameters of a scene's plant from recorded flights.

    An interrupted estimation continues where it was, from FILE.progress beside the airframe file.
    """
    from lapwing.studies.identification import console_output, procedure
    from lapwing.studies.terminal import console
    from lapwing.studies.validation.start_states import TrimMemory

    with user_errors():
        _check_flights(flights)
        if out.suffix != ".toml":
            raise ValueError(f"--out {out}: expected a name that ends in .toml")
        keys = [key.strip() for key in free.split(",") if key.strip()]
        if not keys or len(set(keys)) < len(keys):
            raise ValueError(f"--free {free}: expected different keys with commas between them")
        check_distinct({"--out": out, "--json": json})
        claim(out)
        claim(json)
        memory, progress = TrimMemory(trim_force, trim_torque), out.with_name(f"{out.name}.progress")
        with _bar() as say:
            found = procedure.identify(scene, flights, mapping, keys, memory, set_ or [], windows, seed, progress, say)
        console_output.show(console(), found)
        procedure.write_airframe(out, scene, found, set_ or [])
        typer.echo(f"{out}: the airframe; its first lines hold what belongs to the scene")
        if json:
            console_output.write_json(json, found)


@app.command("import")
def import_(
    flight: Annotated[
        Path, typer.Argument(metavar="FLIGHT", help="a ULog of PX4 (.ulg), or .csv, .csv.gz with --mapping")
    ],
    out: Annotated[Path, typer.Option(metavar="FILE", help="the log to write (.mcap)")],
    mapping: MappingName = None,
) -> None:
    """Convert a recorded flight from an autopilot into a log."""
    from lapwing.studies.flight_import.open_flight import open_flight
    from lapwing.studies.flight_import.ulog_flight import read_ulog_flight
    from lapwing.studies.flight_import.write_log import write_log

    with user_errors():
        _check_flights([flight])
        check_distinct({"FLIGHT": flight, "--out": out})
        if out.suffix != ".mcap" or flight.suffix == ".mcap":
            raise ValueError(f"--out {out}: expected a .mcap file, made from a flight of another format")
        unknown: tuple[str, ...] = ()
        if flight.suffix == ".ulg":
            recording, unknown = read_ulog_flight(flight)
        else:
            recording = open_flight(flight, mapping)
        if not recording.valid.any():
            raise ValueError(f"{flight}: no valid sample; check the --mapping")
        check_log(out)
        write_log(out, recording, flight.name, unknown)
        typer.echo(
            f"{out}: {len(recording) * recording.interval:.1f} s, {int((~recording.valid).sum())} samples left out"
        )
        for cause, count in recording.faults.items():
            typer.echo(f"marked samples: {cause}: {count}")
        for note in recording.notes:
            typer.echo(note)
        if unknown:
            typer.echo(f"topics without a counterpart: {', '.join(unknown)}")


def _horizons(text: str) -> tuple[int, ...]:
    try:
        steps = tuple(int(part) for part in text.split(","))
    except ValueError:
        steps = ()
    if not steps or steps[0] < 1 or any(b <= a for a, b in pairwise(steps)):
        raise ValueError(f"--horizons {text}: expected ascending whole numbers above 0; use 1,10,50")
    return steps


def _check_flights(flights: list[Path]) -> None:
    for path in flights:
        if not path.is_file():
            raise ValueError(f"{path}: no such file; give the path of a recorded flight")


@contextmanager
def _bar() -> Iterator[Callable[[str, int, int], None]]:
    """Progress on a terminal; silence elsewhere."""
    from rich.progress import Progress

    from lapwing.studies.terminal import console

    screen = console()
    with Progress(console=screen, transient=True, disable=not screen.is_terminal) as progress:
        task = progress.add_task("starting", total=1)
        yield lambda text, done, total: progress.update(task, description=text, completed=done, total=max(total, 1))
