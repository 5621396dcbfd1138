"""Terminal tables of `lapwing validate`."""

import math

from rich.console import Console
from rich.table import Table

from lapwing.studies.validation.closed_loop import ClosedLoop
from lapwing.studies.validation.prediction_metrics import FIELDS, Metric
from lapwing.studies.validation.procedure import Validation

UNITS = dict(zip(FIELDS, ("m", "m/s", "rad", "rad/s", "m/s^2", "W"), strict=True))


def show(console: Console, validation: Validation) -> None:
    """Print the errors beside the baselines, and what was left out."""
    extent = f"{validation.windows} windows, {len(validation.flights)} flights"
    table = Table(title=f"{validation.scene}: mean absolute prediction error, {extent}")
    table.add_column("after", justify="right")
    table.add_column("predicted by")
    shown = [k for k, _ in enumerate(FIELDS) if math.isfinite(validation.plant[0][k].mean)]
    for name in (FIELDS[k] for k in shown):
        table.add_column(f"{name.replace('_', ' ')} [{UNITS[name]}]", justify="right")
    for k, steps in enumerate(validation.horizons):
        after = f"{steps * validation.interval:g} s"
        table.add_row(after, "plant", *(with_interval(validation.plant[k][f]) for f in shown))
        for name, rows in validation.baselines.items():
            last = name == list(validation.baselines)[-1]
            table.add_row("", name.replace("_", " "), *(plain(rows[k][f].mean) for f in shown), end_section=last)
    console.print(table)
    for flight in validation.closed_loop:
        console.print(closed_loop_line(flight), soft_wrap=True)
    memory = validation.memory
    console.print(
        f"start: measured state; rotor speeds from past commands; trim from the past {memory.force:g} s (force) and "
        f"{memory.torque:g} s (torque); 95 % intervals over flights",
    )
    for line in validation.skipped:
        console.print(f"left out: {line}", soft_wrap=True)
    faulty = [(f.recording.name, f.recording.faults) for f in validation.flights if f.recording.faults]
    for name, faults in faulty:
        text = ", ".join(f"{cause}: {count}" for cause, count in faults.items())
        console.print(f"marked samples: {name}: {text}")


def closed_loop_line(flight: ClosedLoop) -> str:
    """Return one line on a flight of recorded setpoints."""
    return (
        f"closed loop: {flight.name}: {flight.difference:.3g} m from the recorded flight over {flight.time[-1]:.1f} s; "
        f"tracking error {flight.tracking_error(flight.simulated):.3g} m, "
        f"recorded {flight.tracking_error(flight.recorded):.3g} m"
    )


def with_interval(metric: Metric) -> str:
    """Return mean and interval as text; a dash without measurement, no interval of fewer than three flights."""
    if not math.isfinite(metric.mean):
        return "-"
    if not math.isfinite(metric.low):
        return plain(metric.mean)
    return f"{plain(metric.mean)} ({plain(metric.low)} to {plain(metric.high)})"


def plain(value: float) -> str:
    """Return the value as text; a dash if it is not finite."""
    return f"{value:.3g}" if math.isfinite(value) else "-"
