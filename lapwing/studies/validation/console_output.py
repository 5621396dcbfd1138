"""Terminal tables of `lapwing validate`."""

import math

from rich.console import Console
from rich.table import Table

from lapwing.studies.terminal import COMPACT, counted
from lapwing.studies.validation.closed_loop import ClosedLoop
from lapwing.studies.validation.prediction_metrics import FIELDS
from lapwing.studies.validation.procedure import Validation

UNITS = dict(zip(FIELDS, ("m", "m/s", "rad", "rad/s", "m/s^2", "W"), strict=True))


def show(console: Console, validation: Validation) -> None:
    """Print the errors, those of the baselines, warnings, and the skipped flights."""
    extent = f"{validation.windows} windows, {counted(len(validation.flights), 'flight')}"
    heads, rows = error_table(validation)
    console.print(f"{validation.scene}: mean absolute prediction error, {extent}", soft_wrap=True)
    table = Table(**COMPACT)
    for k, head in enumerate(heads):
        table.add_column(
            head.replace(" ", "\n") if k > 1 else head, justify="left" if k == 1 else "right", no_wrap=True
        )
    for k, row in enumerate(rows):
        table.add_row(*row, end_section=k + 1 == len(rows) or rows[k + 1][0] != row[0])
    console.print(table)
    for flight in validation.closed_loop:
        console.print(closed_loop_line(flight), soft_wrap=True)
    memory = validation.memory
    console.print(
        f"start: measured state; rotor speeds from past commands; trim from the past {memory.force:g} s (force) and "
        f"{memory.torque:g} s (torque); 95 % intervals over flights"
    )
    for line in validation.warnings:
        console.print(f"warning: {line}", soft_wrap=True)
    for line in validation.skipped:
        console.print(f"left out: {line}", soft_wrap=True)
    faulty = [(f.recording.name, f.recording.faults) for f in validation.flights if f.recording.faults]
    for name, faults in faulty:
        text = ", ".join(f"{cause}: {count}" for cause, count in faults.items())
        console.print(f"marked samples: {name}: {text}")


def error_table(validation: Validation) -> tuple[list[str], list[list[str]]]:
    """Return headers and rows of the mean errors: a row for each horizon and measured quantity, one number per cell.

    The plant's 95 % interval has separate columns, which need at least three flights.
    """
    shown = [k for k, _ in enumerate(FIELDS) if math.isfinite(validation.plant[0][k].mean)]
    interval = any(math.isfinite(metric.low) for metrics in validation.plant for metric in metrics)
    names = [name.replace("_", " ") for name in validation.baselines]
    heads = ["after", "error", "plant", *(["95 % from", "95 % to"] if interval else []), *names]
    rows = []
    for k, steps in enumerate(validation.horizons):
        for f in shown:
            metric = validation.plant[k][f]
            numbers = [metric.mean, *([metric.low, metric.high] if interval else [])]
            numbers += [baseline[k][f].mean for baseline in validation.baselines.values()]
            quantity = f"{FIELDS[f].replace('_', ' ')} [{UNITS[FIELDS[f]]}]"
            rows.append([f"{steps * validation.interval:g} s", quantity, *map(plain, numbers)])
    return heads, rows


def closed_loop_line(flight: ClosedLoop) -> str:
    """Return a line on a closed-loop simulation."""
    return (
        f"closed loop: {flight.name}: {flight.difference:.3g} m from the recorded flight over {flight.time[-1]:.1f} s; "
        f"tracking error {flight.tracking_error(flight.simulated):.3g} m, "
        f"recorded {flight.tracking_error(flight.recorded):.3g} m"
    )


def plain(value: float) -> str:
    """Return the value as text, or a dash if it is non-finite."""
    return f"{value:.3g}" if math.isfinite(value) else "-"
