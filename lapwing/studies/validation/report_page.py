"""Report page of `lapwing validate`."""

from pathlib import Path

import numpy as np

from lapwing.cosim.complete_file import write_text
from lapwing.studies.report.page import render
from lapwing.studies.report.plot import Line, Panel, Plot
from lapwing.studies.report.sections import Section
from lapwing.studies.tune.console_output import Rows
from lapwing.studies.validation.console_output import UNITS, error_table
from lapwing.studies.validation.envelope import CHANNELS, explanations, residual_spectra, trends
from lapwing.studies.validation.prediction_metrics import FIELDS
from lapwing.studies.validation.procedure import Validation

SHOWN = ("position", "velocity", "attitude", "rate")
OVERLAID = 3  # flights in the closed-loop plot
COLOURS = ("#1b6ca8", "#c44536", "#4a8f3c")


def write(path: Path, validation: Validation) -> None:
    """Write tables of errors and explanations, errors over the envelope, and residual spectra."""
    after = validation.horizons[-1] * validation.interval
    sections = [
        Section("envelope", "Errors over the envelope", _envelope(validation, after)),
        Section("spectra", "Spectra of the residuals", _spectra(validation)),
    ]
    if validation.closed_loop:
        sections.append(Section("closed-loop", "Closed loop with the recorded setpoints", _closed_loop(validation)))
    lead = (
        f"{validation.windows} windows of {len(validation.flights)} flights. Each starts from the measured state and "
        f"uses the measured motor commands. Trim from the past {validation.memory.force:g} s (force) and "
        f"{validation.memory.torque:g} s (torque)."
    )
    lead += "".join(f" Warning: {line}." for line in validation.warnings)
    page = render(
        "validation.html", title=f"{validation.scene}: prediction of recorded flights", lead=lead,
        outcome=_outcome(validation), sections=sections,
        tables=[_errors(validation), _explained_shares(validation), *_loops(validation), _flights(validation)],
    )  # fmt: skip
    write_text(path, page)


def _outcome(validation: Validation) -> str:
    """Return a text on the errors of the plant after the longest horizon, with that of the best baseline."""
    position, attitude = (FIELDS.index(name) for name in ("position", "attitude"))
    plant = validation.plant[-1]
    best = {name: rows[-1][position].mean for name, rows in validation.baselines.items()}
    name = min(best, key=lambda key: best[key]) if best else ""
    baseline = f"; {name.replace('_', ' ')}: {best[name]:.3g} m" if name else ""
    return (
        f"Mean error of the plant after {validation.horizons[-1] * validation.interval:g} s: "
        f"{plant[position].mean:.3g} m, "
        f"{np.degrees(plant[attitude].mean):.3g}°{baseline}"
    )


def _errors(validation: Validation) -> Rows:
    heads, rows = error_table(validation)
    table = Rows("Mean absolute error", *heads)
    for row in rows:
        table.add(*row)
    return table


def _explained_shares(validation: Validation) -> Rows:
    table = Rows("Share of the residuals that a missing effect would explain", "regressor", "force [%]", "torque [%]")
    for cause, force, torque in explanations(validation):
        table.add(cause, f"{force:.1f}", f"{torque:.1f}")
    return table


def _loops(validation: Validation) -> list[Rows]:
    if not validation.closed_loop:
        return []
    table = Rows(
        "Closed loop", "flight", "duration [s]", "simulated minus recorded [m]", "tracking error, simulated [m]",
        "tracking error, recorded [m]",
    )  # fmt: skip
    for c in validation.closed_loop:
        errors = (c.difference, c.tracking_error(c.simulated), c.tracking_error(c.recorded))
        table.add(c.name, f"{c.time[-1]:.1f}", *(f"{e:.3g}" for e in errors))
    return [table]


def _flights(validation: Validation) -> Rows:
    table = Rows("Flights", "flight", "windows", "predicted / measured specific force", "marked samples", "notes")
    for flight in validation.flights:
        faults = ", ".join(f"{cause}: {n}" for cause, n in flight.recording.faults.items())
        ratio, notes = f"{flight.thrust_ratio:.2f}", "; ".join(flight.recording.notes)
        table.add(flight.recording.name, str(len(flight.starts)), ratio, faults or "none", notes)
    for line in validation.skipped:
        name, _, why = line.partition(": ")
        table.add(name, "0", "", "", why)
    return table


def _envelope(validation: Validation, after: float) -> Plot:
    panels = []
    all_trends = trends(validation)
    for column, trend in enumerate(all_trends):
        for row, name in enumerate(SHOWN):
            line = Line(trend.centres, trend.errors[:, FIELDS.index(name)], marker="circle")
            label = f"{name} [{UNITS[name]}]" if column == 0 else ""
            low = trend.label if row == len(SHOWN) - 1 else ""
            panels.append(Panel((line,), label, low, row=row, column=column, timed=False))
    caption = f"Mean absolute error after {after:g} s by the state at the start of the window."
    return Plot(tuple(panels), caption, 8.0, (1.0,) * len(SHOWN), (1.0,) * max(len(all_trends), 1))


def _closed_loop(validation: Validation) -> Plot:
    panels = []
    flights = validation.closed_loop[:OVERLAID]
    for column, c in enumerate(flights):
        for row, axis in enumerate(CHANNELS):
            lines = (
                Line(c.time, c.setpoint[:, row], "setpoint", COLOURS[2], dash="dot"),
                Line(c.time, c.recorded[:, row], "recorded", COLOURS[0]),
                Line(c.time, c.simulated[:, row], "simulated", COLOURS[1]),
            )
            label = f"{axis} [m]" if column == 0 else ""
            low = f"{c.name}: time [s]" if row == len(CHANNELS) - 1 else ""
            panels.append(Panel(lines, label, low, row=row, column=column, timed=False))
    caption = f"Setpoints of a recording, simulated with the scene's vehicle and autopilot; {len(flights)} flights."
    return Plot(tuple(panels), caption, 7.0, (1.0,) * len(CHANNELS), (1.0,) * len(flights))


def _spectra(validation: Validation) -> Plot:
    frequency, power = residual_spectra(validation)
    panels = []
    for row, (label, first) in enumerate((("force [(m/s^2)^2/Hz]", 0), ("torque [(rad/s^2)^2/Hz]", 3))):
        lines = tuple(
            Line(frequency[1:], power[1:, first + k] if len(power) else np.empty(0), f"{axis}", COLOURS[k])
            for k, axis in enumerate(CHANNELS)
        )
        panels.append(Panel(lines, label, "frequency [Hz]", row=row, timed=False, log_x=True, log_y=True))
    caption = "Measured minus predicted acceleration over one sample, without trim. A flat spectrum is noise."
    return Plot(tuple(panels), caption, 5.0, (1.0, 1.0))
