"""Run summary: the outcome, events and metrics that `lapwing run` prints and writes as JSON."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from rich.console import Console
from rich.table import Table

from lapwing.api.flight import Flight
from lapwing.cli.error_exit import DIFFERENT, FLIGHT_FAILED, fail
from lapwing.cli.run_options import RunOptions
from lapwing.cosim.scene import Scene
from lapwing.flights.flight_data import SHOWN
from lapwing.flights.metrics import joint_end_state, metrics
from lapwing.flights.separation import Separation, nearest
from lapwing.flights.tracking import digits, unit_and_factor
from lapwing.services.common.schemas.run_schema import published_figures
from lapwing.services.common.schemas.success_criteria import Success
from lapwing.studies.json_file import write_json
from lapwing.views import terminal
from lapwing.views.report.write import unavailable

if TYPE_CHECKING:
    from lapwing.runs.observer import Elapsed
    from lapwing.services.process_main import ProcessSpec

MAX_EVENTS = 60  # limit of the printed events
COLOURS = {"good": "green", "warn": "yellow", "bad": "red"}  # by the mark of an outcome


def fleet(log: Path) -> list[Flight]:
    """Return the flights of all vehicles of a log; empty if the run recorded nothing."""
    try:
        return [flight for flight in Flight.read_all(log, SHOWN) if len(flight.truth)]
    except ValueError:
        return []


def report_results(
    scene: Scene,
    spec: "ProcessSpec",
    flights: Sequence[Flight],
    elapsed: "Elapsed | None",
    write_to: Path | None,
    report: Path | None,
) -> None:
    """Write the report and the JSON file, and print the summary.

    Args:
        scene: scene of the run.
        spec: specification of the run.
        flights: recorded flight of each vehicle.
        elapsed: simulated and wall time; None if the run ended early.
        write_to: JSON file to write.
        report: path of the report; None for the path of the log with another extension.
    """
    first, several = flights[0], bool(scene.vehicles)
    lacking = unavailable() if report is None else ""
    result = {
        "scene": scene.name,
        "seed": spec.config.seed,
        "mode": spec.mode,
        "digest": first.digest,
        **(_of_fleet(flights) if several else _of_vehicle(first)),
        "sim_time_s": elapsed.simulated if elapsed else float(first.truth.times[-1]),
        "wall_time_s": elapsed.wall if elapsed else None,
        "real_time_factor": (elapsed.simulated / elapsed.wall if elapsed.wall else 0.0) if elapsed else None,
        "firmware": [text for key, text in first.metadata.items() if key.rpartition("/")[2].startswith("firmware")],
        "log": str(first.origin.source),
        "report": None if lacking else str(first.report(report, view3d=False)),
    }
    if write_to:
        write_json(write_to, result)
    if several:
        show_fleet(terminal.console(), result)
    else:
        show(terminal.console(), scene, result)
    if lacking:
        terminal.console().print(f"report  none: {lacking}", markup=False, soft_wrap=True)


def _of_vehicle(flight: Flight) -> dict[str, Any]:
    outcome = flight.outcome
    return {
        "outcome": {"text": str(outcome), "mark": outcome.mark, **outcome._asdict()},
        "events": [event._asdict() for event in flight.events],
        "rmse": flight.rmse,
        "landed": flight.landed,
    }


def _of_fleet(flights: Sequence[Flight]) -> dict[str, Any]:
    return {
        "vehicles": {flight.vehicle: _of_vehicle(flight) for flight in flights},
        "separation": nearest(flights[0].fleet)._asdict() if len(flights) > 1 else None,
    }


def show(console: Console, scene: Scene, result: dict[str, Any]) -> None:
    """Print the summary of a run."""
    _outcome(console, result["outcome"])
    show_events(console, result["events"])
    _errors(console, published_figures(scene.resolved), result["rmse"])
    _ending(console, result)


def show_fleet(console: Console, result: dict[str, Any]) -> None:
    """Print the summary of a run with several vehicles."""
    for name, vehicle in result["vehicles"].items():
        _outcome(console, vehicle["outcome"], f"{name}: ")
    if result["separation"]:
        console.print(str(Separation(**result["separation"])))
    _ending(console, result)


def _outcome(console: Console, outcome: dict[str, Any], prefix: str = "") -> None:
    console.print(f"{prefix}{outcome['text']}", style=f"bold {COLOURS[outcome['mark']]}", markup=False)


def _ending(console: Console, result: dict[str, Any]) -> None:
    if result["wall_time_s"] is not None:
        console.print(
            f"{result['sim_time_s']:.1f} s simulated in {result['wall_time_s']:.1f} s: "
            f"real-time factor {result['real_time_factor']:.1f} ({result['mode']})"
        )
    for line in result["firmware"]:
        console.print(line, soft_wrap=True)
    for name in ("digest", "log", "report"):
        if result[name]:
            console.print(f"{name:<7} {result[name]}", soft_wrap=True)


def show_events(console: Console, events: list[dict[str, Any]]) -> None:
    """Print the first `MAX_EVENTS` events."""
    if not events:
        return
    table = Table("time [s]", "event", "", box=None, pad_edge=False, header_style="dim")
    table.columns[0].justify = "right"
    for event in events[:MAX_EVENTS]:
        table.add_row(f"{event['time']:.2f}", event["kind"], event["text"])
    console.print(table)
    if len(events) > MAX_EVENTS:
        console.print(f"{len(events) - MAX_EVENTS} more events not shown (see the report or --json)")


def _errors(console: Console, figures: dict[str, Any], rmse: dict[str, float]) -> None:
    published = figures.get("rmse", {})
    if not any(map(math.isfinite, rmse.values())):
        return  # there is no reference, or the motors were never armed
    console.print("Root-mean-square error against the reference")
    table = Table()
    table.add_column("axis")
    table.add_column("this run", justify="right")
    if published:
        table.add_column(figures.get("source", "published"), justify="right")
    for axis, value in rmse.items():
        unit, scale = unit_and_factor(axis)
        row = [f"{axis} [{unit}]", digits(scale * value)]
        if published:
            row.append(digits(scale * published[axis]) if axis in published else "")
        table.add_row(*row)
    console.print(table)


def compare_with_campaign(options: RunOptions, flights: Sequence[Flight]) -> None:
    """Print whether the repeated run ends in the state recorded in its campaign; exit with 4 if it does not."""
    if options.run_ is None or options.campaign is None:
        return
    from lapwing.studies.campaign import single_run  # imports scipy

    recorded = single_run.end_state_of(options.run_, options.campaign)
    name = f"run {options.run_} of {options.campaign}"
    if not recorded:
        typer.echo(f"{name}: not recorded in the campaign yet")
    elif recorded == joint_end_state(flights):
        typer.echo(f"{name}: final state bit-for-bit identical")
    elif options.set_:
        typer.echo(f"{name}: final state differs, with --set")
    else:
        fail(f"{name}: final state differs", DIFFERENT)


def check_success(scene: Scene, flights: Sequence[Flight]) -> None:
    """Exit with 4 if a flight does not meet success.require of the scene."""
    failures = [
        f"flight{f' of {flight.vehicle}' if scene.vehicles else ''} failed: {flight.outcome.kind}; "
        f"success.require: {shortfall}"
        for flight, vehicle in zip(flights, scene.each_vehicle, strict=False)
        if (shortfall := vehicle[Success].shortfall(metrics(flight)))
    ]
    if failures:
        fail("; ".join(failures), FLIGHT_FAILED)
