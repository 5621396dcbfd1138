"""Report page of `lapwing validate`."""

from pathlib import Path

import numpy as np

from lapwing.studies.report.page import render
from lapwing.studies.report.plot import Line, Panel, Plot
from lapwing.studies.report.sections import Section
from lapwing.studies.tune.console_output import Rows
from lapwing.studies.validation.console_output import UNITS
from lapwing.studies.validation.envelope import CHANNELS, explanations, residual_spectra, trends
from lapwing.studies.validation.prediction_metrics import FIELDS
from lapwing.studies.validation.procedure import Validation

SHOWN = ("position", "velocity", "attitude", "rate")
COLOURS = ("#1b6ca8", "#c44536", "#4a8f3c")


def write(path: Path, found: Validation) -> None:
    """Write tables of errors and explanations, errors over the envelope, and residual spectra."""
    after = found.horizons[-1] * found.interval
    sections = [
        Section("envelope", "Errors over the envelope", _envelope(found, after)),
        Section("spectra", "Spectra of the residuals", _spectra(found)),
    ]
    lead = (
        f"{found.windows} windows of {len(found.flights)} flights. Each starts from the measured state and is fed the "
        f"measured motor commands. Trim from the past {found.memory.force:g} s (force) and "
        f"{found.memory.torque:g} s (torque)."
    )
    page = render(
        "validation.html", title=f"{found.scene}: prediction of recorded flights", lead=lead,
        tables=[_errors(found), _explained(found), _flights(found)], sections=sections,
    )  # fmt: skip
    path.write_text(page, encoding="utf-8")


def _errors(found: Validation) -> Rows:
    heads = [f"{name.replace('_', ' ')} [{UNITS[name]}]" for name in FIELDS]
    table = Rows("Mean absolute error", "after, by", *heads)
    for k, steps in enumerate(found.horizons):
        after = f"{steps * found.interval:g} s"
        table.add(f"{after}, plant", *(f"{m.mean:.3g} ({m.low:.3g} to {m.high:.3g})" for m in found.plant[k]))
        for name, rows in found.baselines.items():
            table.add(f"{after}, {name.replace('_', ' ')}", *(f"{m.mean:.3g}" for m in rows[k]))
    return table


def _explained(found: Validation) -> Rows:
    table = Rows("Share of the residuals that a missing effect would explain", "regressor", "force [%]", "torque [%]")
    for cause, force, torque in explanations(found):
        table.add(cause, f"{force:.1f}", f"{torque:.1f}")
    return table


def _flights(found: Validation) -> Rows:
    table = Rows("Flights", "flight", "windows", "marked samples", "notes")
    for flight in found.flights:
        faults = ", ".join(f"{cause}: {n}" for cause, n in flight.recording.faults.items())
        table.add(flight.recording.name, str(len(flight.starts)), faults or "none", "; ".join(flight.recording.notes))
    for line in found.skipped:
        name, _, why = line.partition(": ")
        table.add(name, "0", "", why)
    return table


def _envelope(found: Validation, after: float) -> Plot:
    panels = []
    every = trends(found)
    for column, trend in enumerate(every):
        for row, name in enumerate(SHOWN):
            line = Line(trend.centres, trend.errors[:, FIELDS.index(name)], marker="circle")
            label = f"{name} [{UNITS[name]}]" if column == 0 else ""
            low = trend.label if row == len(SHOWN) - 1 else ""
            panels.append(Panel((line,), label, low, row=row, column=column, timed=False))
    caption = f"Mean absolute error after {after:g} s by the state at the start of the window."
    return Plot(tuple(panels), caption, 8.0, (1.0,) * len(SHOWN), (1.0,) * max(len(every), 1))


def _spectra(found: Validation) -> Plot:
    frequency, power = residual_spectra(found)
    panels = []
    for row, (label, first) in enumerate((("force [(m/s^2)^2/Hz]", 0), ("torque [(rad/s^2)^2/Hz]", 3))):
        lines = tuple(
            Line(frequency[1:], power[1:, first + k] if len(power) else np.empty(0), f"{axis}", COLOURS[k])
            for k, axis in enumerate(CHANNELS)
        )
        panels.append(Panel(lines, label, "frequency [Hz]", row=row, timed=False, log_x=True, log_y=True))
    caption = "Measured less predicted acceleration over one sample, without trim. A flat spectrum is noise."
    return Plot(tuple(panels), caption, 5.0, (1.0, 1.0))
