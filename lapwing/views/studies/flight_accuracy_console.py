"""Accuracy of a scene's flight as a table and as JSON."""

import math
from pathlib import Path

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from lapwing.dynamics import integrators
from lapwing.studies import json_file
from lapwing.studies.accuracy.flight_accuracy import FlightAccuracy
from lapwing.studies.accuracy.state_errors import worst_of


def show(console: Console, result: FlightAccuracy) -> None:
    """Print the errors as a table, and their interpretation."""
    lines = [
        f"{result.integrator}, step {1e3 * result.step:g} ms, against steps of {1e3 * result.reference_step:g} ms; "
        f"{result.duration:g} s, errors relative to 1 + size",
        _table(result),
        *_column_legend(result),
        _verdict(result),
        *_held(result),
        *_closed_loop(result),
        *_remedy(result),
    ]
    for line in lines:
        console.print(line, highlight=False, soft_wrap=True)


def _table(result: FlightAccuracy) -> Table:
    fleet = len({quantity.vehicle for quantity in result.quantities}) > 1
    closed_loop = {(q.vehicle, q.name): q for q in result.closed_loop.quantities} if result.closed_loop else {}
    table = Table(box=SIMPLE, pad_edge=False, padding=(0, 0) if closed_loop else (0, 1))  # within 80 columns
    names = ["solver error" if result.part_length else "largest error", "/ accuracy", "at (s)"]
    table.add_column("quantity", no_wrap=True)
    for name in [*names, *(["closed loop", "at (s)"] if closed_loop else [])]:
        table.add_column(name, justify="right", no_wrap=True, min_width=len(name))
    for q in result.quantities:
        label = f"{q.vehicle}: {q.name}" if fleet else q.name
        cells = [label, f"{q.error:.1e}", f"{q.error / result.accuracy:.2g}", f"{q.time:.3f}"]
        if closed_loop:
            other = closed_loop[q.vehicle, q.name]
            cells += [f"{other.error:.1e}", f"{other.time:.3f}"]
        table.add_row(*cells)
    return table


def _column_legend(result: FlightAccuracy) -> list[str]:
    """Return the meaning of the columns in a table with errors of parts."""
    if result.part_length is None:
        return []
    lines = [
        f"solver error: parts of {result.part_length:g} s repeated with finer steps, from the recorded states and "
        "under the recorded motor commands"
    ]
    if result.closed_loop:
        lines.append("closed loop: entire flight repeated with finer steps, with sensors and autopilot")
    return lines


def _verdict(result: FlightAccuracy) -> str:
    subject = "accuracy of the solver" if result.part_length else "accuracy"
    worst = result.worst
    verdict = "met" if worst.error <= result.accuracy else "missed"
    return (
        f"{subject} {verdict}: error {worst.error:.1e}, required {result.accuracy:g} ({worst.name}, {worst.time:.3f} s)"
    )


def _held(result: FlightAccuracy) -> list[str]:
    """Return the error by what the plant holds over a communication step."""
    if not result.held:
        return []
    fleet, worst = len({quantity.vehicle for quantity in result.held}) > 1, worst_of(result.held)
    subject = f"{'neighbours and ' if fleet else ''}held quantities, updated at {result.update_rate:g} Hz"
    verdict = "met" if worst.error <= result.accuracy else "missed"
    return [f"{subject}: {verdict}, error {worst.error:.1e} ({worst.name}, {worst.time:.3f} s)"]


def _closed_loop(result: FlightAccuracy) -> list[str]:
    """Return the reason for a difference of the closed loop beyond the accuracy."""
    if result.closed_loop is None:
        return []
    loop = result.closed_loop
    worst, shifted = worst_of(loop.quantities), loop.difference
    lines = [
        f"closed loop: {worst.error:.1e} ({worst.name}, {worst.time:.3f} s), amplified by sensors and autopilot: "
        f"an initial difference of {loop.start_difference:g} grows to {shifted.error:.1e} "
        f"({shifted.name}, {shifted.time:.3f} s) with equal steps"
    ]
    if loop.signal:
        name, difference, time = loop.signal
        lines.append(
            f"first signal that differs by more than {result.accuracy:g}: {name}, by {difference:.1e} at {time:.3f} s, "
            f"where the true state differs by {loop.true_difference:.1e}"
        )
    return lines


def _remedy(result: FlightAccuracy) -> list[str]:
    """Return the remedy for a missed accuracy."""
    if result.met:
        return []
    if result.worst.error <= result.accuracy:
        error = worst_of(result.held).error
        return [
            f"communication.rate: {result.update_rate:g} Hz holds quantities with an error of {error:.1e}, which no "
            f"step reduces; use a higher rate, or an accuracy of at least {error:.1e}"
        ]
    if not result.step_selected:
        cause = f"solver.step: set to {result.step:g} s, which does not depend on the accuracy"
        return [f"{cause}; remove it to select a step"]
    cause = "solver.step: selected for a gentler flight"
    count = math.ceil((result.worst.error / result.accuracy) ** (1.0 / integrators.get(result.integrator).ORDER))
    return [f"{cause}; use --set solver.integrator={result.integrator} --set solver.step={result.step / count:.12g}"]


def write_json(path: Path, result: FlightAccuracy) -> None:
    """Write the errors."""
    json_file.write_json(path, {**result._asdict(), "error": result.worst.error, "worst": result.worst})
