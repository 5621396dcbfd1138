"""Commands on real flights: validate, identify, import."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lapwing.cli.app import app
from lapwing.cli.options import Overrides, SceneFile
from lapwing.cli.output_paths import check_distinct, check_log, claim, claim_named
from lapwing.cosim.complete_file import write_text

if TYPE_CHECKING:
    from rich.table import Table

    from lapwing.flights.log_import.recording import SourceRow

Flights = Annotated[
    list[Path], typer.Argument(metavar="FLIGHTS...", help="Lapwing logs (.mcap), or logs that `lapwing import` reads")
]
MappingName = Annotated[
    str | None,
    typer.Option(
        "--mapping", metavar="NAME|FILE", help="columns: nanobench, betaflight, crazyflie_usd, or a .toml file"
    ),
]
TrimForce = Annotated[float, typer.Option(metavar="S", min=0.0, help="time constant of the force trim; 0: no trim")]
TrimTorque = Annotated[float, typer.Option(metavar="S", min=0.0, help="time constant of the torque trim; 0: no trim")]
FORCE_MEMORY, TORQUE_MEMORY = 0.15, 10.0  # [s] equal to `start_states.USUAL_TRIM`, which takes time to import
UNUSED_MAPPING = "--mapping {}: {} needs none; leave out the option, which is for CSV files and logs of the Crazyflie"


@app.command()
def validate(
    scene: SceneFile,
    flights: Flights,
    mapping: MappingName = None,
    horizons: Annotated[str, typer.Option(metavar="N,N,...", help="samples after which to compare")] = "1,10,50",
    stride: Annotated[int, typer.Option(metavar="N", min=1, help="samples between the starts of two windows")] = 5,
    trim_force: TrimForce = FORCE_MEMORY,
    trim_torque: TrimTorque = TORQUE_MEMORY,
    closed_loop: Annotated[
        bool, typer.Option("--closed-loop", help="fly the recorded setpoints with the scene's autopilot, too")
    ] = False,
    set_: Overrides = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write all errors as JSON")] = None,
    report: Annotated[Path | None, typer.Option(metavar="FILE", help="write errors over the envelope (HTML)")] = None,
) -> None:
    """Measure how well a scene's plant predicts recorded flights."""
    from lapwing.cli.progress import step_progress
    from lapwing.studies.validation import procedure
    from lapwing.studies.validation.start_states import TrimMemory
    from lapwing.views.studies.study_result import show, write_json, write_report
    from lapwing.views.studies.validation_result import validation_result
    from lapwing.views.terminal import console

    steps = _horizons(horizons)
    _check_flights(flights, mapping)
    check_distinct({"--json": json, "--report": report})
    claim(json)
    claim_named("--report", report, ".html")
    with step_progress(console(), "steps") as say:
        memory = TrimMemory(trim_force, trim_torque)
        found = procedure.validate(scene, flights, mapping, steps, set_ or [], memory, stride, closed_loop, say)
    result = validation_result(found)
    if json:
        write_json(json, result)
    if report:
        write_report(report, result)
    show(console(), result)
    if report:
        typer.echo(f"{report}: errors over the envelope and residual spectra")


@app.command()
def identify(
    context: typer.Context,
    scene: SceneFile,
    flights: Flights,
    out: Annotated[
        Path, typer.Option(metavar="FILE", help="output file (.toml): the airframe, or with --sensors the sensors")
    ],
    free: Annotated[str, typer.Option(metavar="KEY,KEY,...", help="parameters to estimate: numbers of the scene")] = "",
    sensors: Annotated[
        bool, typer.Option("--sensors", help="estimate noise, bias and latency of sensors instead")
    ] = False,
    mapping: MappingName = None,
    windows: Annotated[int, typer.Option(metavar="N", min=20, help="approximate number of windows to fit")] = 1000,
    trim_force: TrimForce = FORCE_MEMORY,
    horizons: Annotated[str, typer.Option(metavar="N,N,...", help="samples after which errors count")] = "10,25,50",
    trim_torque: TrimTorque = TORQUE_MEMORY,
    seed: Annotated[int, typer.Option(metavar="N", help="seed of the choice of held-out flights")] = 1,
    set_: Overrides = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write estimates and correlations as JSON")] = None,
) -> None:
    """Estimate parameters of a scene's plant from recorded flights.

    An interrupted estimation resumes from FILE.progress next to the airframe file.
    """
    from lapwing.cli.progress import step_progress
    from lapwing.studies.identification import procedure
    from lapwing.studies.validation.start_states import TrimMemory
    from lapwing.views.studies.study_result import show, write_json
    from lapwing.views.studies.validation_result import identification_result
    from lapwing.views.terminal import console

    _check_flights(flights, mapping)
    if out.suffix != ".toml":
        raise ValueError(f"--out {out}: expected a name that ends in .toml")
    if sensors:
        _check_sensor_options(context)
        _fit_sensors(flights, mapping, out)
        return
    keys = [key.strip() for key in free.split(",") if key.strip()]
    if not keys:
        raise ValueError("--free: missing; name the keys to estimate (airframe.mass.total,...), or use --sensors")
    if len(set(keys)) < len(keys):
        raise ValueError(f"--free {free}: contains a key twice; expected different keys")
    steps = _horizons(horizons)
    check_distinct({"--out": out, "--json": json})
    claim(out)
    claim(json)
    memory, progress = TrimMemory(trim_force, trim_torque), out.with_name(f"{out.name}.progress")
    with step_progress(console(), "steps") as say:
        result = procedure.identify(
            scene, flights, mapping, keys, memory, set_ or [], windows, seed, progress, say, horizons=steps
        )
    page = identification_result(result)
    procedure.write_airframe(out, scene, result, set_ or [])
    if json:
        write_json(json, page)
    show(console(), page)
    typer.echo(f"{out}: the airframe; its first lines contain the values for the scene")
    if procedure.joint_distribution(result.fit):
        typer.echo(f"lapwing campaign {scene} --vary {out}: flies vehicles that are as uncertain as the estimates")


def _is_on_command_line(context: typer.Context, name: str) -> bool:
    source = context.get_parameter_source(name)
    return source is not None and source.name == "COMMANDLINE"


def _check_sensor_options(context: typer.Context) -> None:
    """Raise ValueError for an option on the command line that `--sensors` does not use."""
    used = {"scene", "flights", "out", "sensors", "mapping"}
    names = [name for name in context.params if name not in used and _is_on_command_line(context, name)]
    unused = [f"--{name.strip('_').replace('_', '-')}" for name in names]
    if unused:
        raise ValueError(f"--sensors: estimates all sensors, from all samples; leave out {', '.join(unused)}")


def _fit_sensors(flights: list[Path], mapping: str | None, out: Path) -> None:
    from lapwing.cosim.scene.toml_text import dump
    from lapwing.flights.log_import.open_flight import open_flight
    from lapwing.studies.identification.sensor_fit import fit_all

    claim(out)
    tables, notes = fit_all([open_flight(path, mapping) for path in flights])
    names = ", ".join(path.name for path in flights)
    text = dump({"sensors": tables})
    write_text(out, f"# Sensors as estimated from {names}; put these tables into a scene.\n\n{text}")
    typer.echo(f"{out}: {', '.join(tables)}; put the tables into a scene")
    for note in notes:
        typer.echo(note)


@app.command("import")
def import_(
    flight: Annotated[
        Path, typer.Argument(metavar="FLIGHT", help="a log of PX4, ArduPilot, MAVLink, Betaflight, ROS 2 or a CSV file")
    ],
    out: Annotated[Path, typer.Option(metavar="FILE", help="the log to write (.mcap)")],
    mapping: MappingName = None,
    vehicle: Annotated[
        str | None, typer.Option(metavar="NAME", help="namespace of the vehicle in a rosbag2 with several")
    ] = None,
    instance: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=N", help="instance to use of a signal of the table, or of the log's messages"),
    ] = None,
    twist_frame: Annotated[
        str, typer.Option(metavar="AXES", help="axes of an odometry's twist: body, world, or none to leave it out")
    ] = "",
) -> None:
    """Convert a recorded flight into a log and list its sources.

    Formats: ULog (.ulg), dataflash (.bin, .log), MAVLink telemetry (.tlog), rosbag2 folders and files (.mcap, .db3),
    logs of the Crazyflie's uSD deck, and CSV files (.csv, .csv.gz) with --mapping.
    """
    from lapwing.flights.log_import.log_flight import is_log
    from lapwing.flights.log_import.open_flight import open_flight
    from lapwing.flights.log_import.source_choice import choices_of
    from lapwing.flights.log_import.write_log import write_log
    from lapwing.views.terminal import console

    check_distinct({"FLIGHT": flight, "--out": out})
    if out.suffix != ".mcap":
        raise ValueError(f"--out {out}: expected a name that ends in .mcap")
    if flight.suffix == ".mcap" and flight.is_file() and is_log(flight):
        raise ValueError(f"{flight}: is a Lapwing log already; use it without import, e.g. lapwing report {flight}")
    check_log(out)
    claim(out)
    recording = open_flight(flight, mapping, vehicle, choices_of(instance or [], twist_frame))
    _check_mapping([flight], mapping)
    if not recording.valid.any():
        raise ValueError(f"{flight}: no valid sample; check the --mapping")
    write_log(out.resolve(), recording, flight.name)
    typer.echo(f"{out}: {len(recording) * recording.interval:.1f} s, {int((~recording.valid).sum())} samples left out")
    for cause, count in recording.faults.items():
        typer.echo(f"marked samples: {cause}: {count}")
    for note in recording.notes:
        typer.echo(note)
    if recording.unknown:
        typer.echo(f"topics without a counterpart: {', '.join(recording.unknown)}")
    console().print(_source_table(recording.sources))
    typer.echo("left out: number of samples; of resets and jumps, of events")


def _source_table(rows: Sequence["SourceRow"]) -> "Table":
    """Return the table that an import ends with, at most 80 columns wide."""
    from rich.table import Table

    from lapwing.views.terminal import COMPACT

    table = Table(**COMPACT)
    widths = {"signal": None, "source, instance": 22, "frame, datum": 10, "samples": None, "left out": None}
    for head, width in widths.items():
        table.add_column(head, justify="right" if head == "samples" else "left", overflow="fold", width=width)
    for row in rows:
        source = " ".join(filter(None, (row.source, row.instance)))
        axes = ", ".join(filter(None, (row.frame, row.datum)))
        table.add_row(row.signal, source or "-", axes or "-", str(row.samples), row.left_out.replace(", ", "\n"))
    return table


def _horizons(text: str) -> tuple[int, ...]:
    try:
        steps = tuple(int(part) for part in text.split(","))
    except ValueError:
        steps = ()
    if not steps or steps[0] < 1 or any(b <= a for a, b in pairwise(steps)):
        raise ValueError(f"--horizons {text}: expected ascending whole numbers above 0; use 1,10,50")
    return steps


def _check_flights(flights: list[Path], mapping: str | None) -> None:
    for path in flights:
        if not path.exists():
            raise ValueError(f"{path}: no such file or directory; expected a recorded flight")
    _check_mapping(flights, mapping)


def _check_mapping(flights: list[Path], mapping: str | None) -> None:
    """Raise ValueError if no file uses the mapping."""
    from lapwing.flights.log_import.open_flight import takes_mapping

    if mapping is not None and not any(map(takes_mapping, flights)):
        raise ValueError(UNUSED_MAPPING.format(mapping, flights[0]))
