"""Result of `lapwing validate` and of `lapwing identify`."""

import math
from functools import partial

import numpy as np

from lapwing.studies.identification.procedure import Identification, joint_distribution
from lapwing.studies.validation.envelope import CHANNELS, explanations, residual_spectra, trends
from lapwing.studies.validation.prediction_metrics import FIELDS, Metric, magnitudes, pool
from lapwing.studies.validation.procedure import FlightErrors, Validation
from lapwing.studies.validation.verdict import Comparison, as_json, basis, comparisons, facts, sentence
from lapwing.views.report.plot import Line, Panel, Plot
from lapwing.views.studies.study_result import Rows, StudyResult
from lapwing.views.terminal import counted

SHOWN = ("position", "velocity", "attitude", "rate")
OVERLAID = 3  # flights in the closed-loop plot
COLOURS = ("#1b6ca8", "#c44536", "#4a8f3c")
WRAPPED = 5  # columns of a table whose heads have a word per line, for 80 columns of a terminal
UNITS = dict(zip(FIELDS, ("m", "m/s", "rad", "rad/s", "m/s²", "W"), strict=True))
CORRELATED = 0.8  # correlation of two estimates above which it is listed


def validation_result(validation: Validation) -> StudyResult:
    """Return the result of a validation: errors and explanations, errors over the envelope, and residual spectra."""
    memory, loops = validation.memory, validation.closed_loop
    extent = f"{counted(len(validation.flights), 'flight')}, {validation.windows} windows"
    notes = [
        "start: measured state; rotor speeds from the past measured motor commands; trim from the past "
        f"{memory.force:g} s (force) and {memory.torque:g} s (torque)",
        *(f"warning: {line}" for line in validation.warnings),
        *(f"left out: {line}" for line in validation.skipped),
    ]
    for name, faults in [(f.recording.name, f.recording.faults) for f in validation.flights if f.recording.faults]:
        notes.append(f"marked samples: {name}: {', '.join(f'{cause}: {count}' for cause, count in faults.items())}")
    plots = {"Errors over the envelope": partial(_envelope, validation)}
    plots["Spectra of the residuals"] = partial(_spectra, validation)
    if loops:
        plots["Closed loop with the recorded setpoints"] = partial(_closed_loop, validation)
    return StudyResult(
        f"{validation.scene} on {extent}", sentence(validation), "", _lead(validation),
        (_verdict(validation), error_table(validation), _loops(validation), _explained(validation),
         _flights(validation)),
        plots, tuple(notes), data=_json(validation),
    )  # fmt: skip


def _lead(validation: Validation) -> tuple[str, ...]:
    missing = ", ".join(validation.missing)
    line = f"not in the logs, thus made up and not compared: {missing}"
    return (*((line,) if missing else ()), *facts(validation))


def identification_result(identification: Identification) -> StudyResult:
    """Return the result of an identification: estimates, correlations, errors on held-out flights, and the verdict."""
    fit, after = identification.fit, identification.after
    held_out = len(identification.held_out)
    flights = counted(held_out, "held-out flight") if held_out else "the flights that were fitted"
    rows = Rows("Estimates", "parameter", "before", "estimate", "standard\nerror")
    for key, before, value, error in zip(fit.keys, fit.start, fit.values, fit.standard_errors, strict=True):
        rows.add(key, f"{before:.5g}", f"{value:.5g}", f"{error:.2g}")
    time = after.horizons[-1] * after.interval
    errors = Rows(f"Error after {time:.3g} s on {flights}", "quantity", "before", "after")
    for name, before, now in zip(FIELDS, identification.before.plant[-1], after.plant[-1], strict=True):
        if np.isfinite(now.mean):  # measured by a held-out flight
            errors.add(f"{name.replace('_', ' ')} [{UNITS[name]}]", f"{before.mean:.3g}", f"{now.mean:.3g}")
    correlated = [
        f"correlated: {fit.keys[i]} and {fit.keys[j]}: {fit.correlations[i, j]:+.2f}"
        for i, j in zip(*np.triu_indices(len(fit.keys), 1), strict=True)
        if abs(fit.correlations[i, j]) > CORRELATED
    ]
    notes = [
        *(f"left out: {line}" for line in identification.skipped),
        *correlated,
        *(f"not determined by these flights: {key}" for key in fit.undetermined),
        *(f"not known without positions: {line}" for line in identification.unknown),
    ]
    parameters = {
        key: {"start": a, "estimate": b, "standard_error": c, "determined": key not in fit.undetermined}
        for key, a, b, c in zip(fit.keys, fit.start, fit.values, fit.standard_errors, strict=True)
    }
    means = zip(FIELDS, identification.before.plant[-1], after.plant[-1], strict=True)
    used = counted(len(identification.used), "flight")
    return StudyResult(
        f"{identification.scene} with the estimates on {flights}", sentence(after), "",
        (f"output error on {used}", *_lead(after)), (rows, errors, _verdict(after)),
        notes=tuple(notes),
        data={
            "scene": identification.scene,
            "verdict": as_json(after),
            "parameters": parameters,
            **joint_distribution(fit),
            "loss": fit.cost,
            "flights": identification.used,
            "held_out": identification.held_out,
            "left_out": identification.skipped,
            "unknown_without_positions": identification.unknown,
            "held_out_errors": {name: {"before": a.mean, "after": b.mean} for name, a, b in means},
        },
    )  # fmt: skip


def _verdict(validation: Validation) -> Rows:
    """Return the comparisons: a row for each horizon and measured quantity."""
    names = list(validation.ratios)
    heads = _heads(["after", "error", *(f"over {name.replace('_', ' ')}" for name in names)])
    rows = Rows(f"Error of the plant over that of the baseline, {basis(validation)}", *heads, texts=("error",))
    for c in comparisons(validation):
        ratios = (_ratio(c, name) if name in c.ratios else "-" for name in names)
        rows.add(f"{c.time:.3g} s", c.field.replace("_", " "), *ratios)
    return rows


def _heads(names: list[str]) -> list[str]:
    return names if len(names) < WRAPPED else [name.replace(" ", "\n") for name in names]


def _ratio(comparison: Comparison, baseline: str) -> str:
    ratio = comparison.ratios[baseline]
    mean, low, high = ("<0.01" if x < 0.005 else f"{x:.2f}" for x in (ratio.mean, ratio.low, ratio.high))
    if not math.isfinite(ratio.low):
        return mean
    return f"{mean} [{low}, {high}] {comparison.outcome(baseline)}"


def error_table(validation: Validation) -> Rows:
    """Return the mean errors: a row for each horizon and measured quantity, one number per cell.

    The plant's 95 % interval has separate columns.
    """
    shown = [k for k, _ in enumerate(FIELDS) if math.isfinite(validation.plant[0][k].mean)]
    interval = any(math.isfinite(metric.low) for metrics in validation.plant for metric in metrics)
    names = [name.replace("_", " ") for name in validation.baselines]
    heads = ["after [s]", "error", "plant", *(["95 % from", "95 % to"] if interval else []), *names]
    rows = Rows("Mean absolute prediction error", *_heads(heads), texts=("error",))
    for k, steps in enumerate(validation.horizons):
        for f in shown:
            metric = validation.plant[k][f]
            numbers = [metric.mean, *([metric.low, metric.high] if interval else [])]
            numbers += [baseline[k][f].mean for baseline in validation.baselines.values()]
            quantity = f"{FIELDS[f].replace('_', ' ')} [{UNITS[FIELDS[f]]}]"
            rows.add(f"{steps * validation.interval:.3g}", quantity, *map(plain, numbers))
    return rows


def plain(value: float) -> str:
    """Return the value as text, or a dash if it is non-finite."""
    return f"{value:.3g}" if math.isfinite(value) else "-"


def _json(validation: Validation) -> dict:
    """Return the verdict, then errors, confidence intervals and baselines by horizon."""
    rows = []
    for k, steps in enumerate(validation.horizons):
        row: dict = {"steps": steps, "time": steps * validation.interval, "windows": validation.windows}
        row |= _values(validation.plant[k])
        row["confidence_95"] = {name: [m.low, m.high] for name, m in zip(FIELDS, validation.plant[k], strict=True)}
        row["baselines"] = {name: _values(rows_of[k]) for name, rows_of in validation.baselines.items()}
        rows.append(row)
    flights = {f.recording.name: _flight(validation, f) for f in validation.flights}
    content = {
        "scene": validation.scene,
        "verdict": as_json(validation),
        "trim": validation.memory,
        "horizons": rows,
        "flights": flights,
        "missing": validation.missing,
        "skipped": validation.skipped,
        "warnings": validation.warnings,
    }
    if validation.closed_loop:
        content["closed_loop"] = [
            {
                "flight": c.name,
                "seconds": c.time[-1],
                "difference": c.difference,
                "tracking_error": {name: c.tracking_error(getattr(c, name)) for name in ("simulated", "recorded")},
            }
            for c in validation.closed_loop
        ]
    return content


def _flight(validation: Validation, flight: FlightErrors) -> dict:
    last = magnitudes(flight.plant)[:, -1:]
    means = _values(pool(last, np.zeros(len(last), int))[0])
    return {
        "windows": len(flight.starts),
        **means,
        "thrust_ratio": flight.thrust_ratio,
        "faults": flight.recording.faults,
        "notes": flight.recording.notes,
    }


def _values(metrics: list[Metric]) -> dict[str, float]:
    return {name: m.mean for name, m in zip(FIELDS, metrics, strict=True)}


def _explained(validation: Validation) -> Rows:
    title = "Share of the residuals that a missing effect would explain"
    table = Rows(title, "regressor", "force [%]", "torque [%]", only="page")
    for cause, force, torque in explanations(validation) if validation.flights else ():
        table.add(cause, f"{force:.1f}", f"{torque:.1f}")
    return table


def _loops(validation: Validation) -> Rows:
    table = Rows(
        "Closed loop: distance from the recorded flight, and tracking errors", "flight", "time [s]", "distance\n[m]",
        "simulated\n[m]", "recorded\n[m]",
    )  # fmt: skip
    for c in validation.closed_loop:
        errors = (c.difference, c.tracking_error(c.simulated), c.tracking_error(c.recorded))
        table.add(c.name, f"{c.time[-1]:.1f}", *(f"{e:.3g}" for e in errors))
    return table


def _flights(validation: Validation) -> Rows:
    heads, texts = ("flight", "windows", "predicted / measured specific force"), ("marked samples", "notes")
    table = Rows("Flights", *heads, *texts, texts=texts, only="page")
    for flight in validation.flights:
        faults = ", ".join(f"{cause}: {n}" for cause, n in flight.recording.faults.items())
        ratio, notes = f"{flight.thrust_ratio:.2f}", "; ".join(flight.recording.notes)
        table.add(flight.recording.name, str(len(flight.starts)), ratio, faults or "none", notes)
    for line in validation.skipped:
        name, _, why = line.partition(": ")
        table.add(name, "0", "", "", why)
    return table


def _envelope(validation: Validation) -> Plot:
    after = validation.horizons[-1] * validation.interval
    panels = []
    found = trends(validation)
    all_trends = [trend for trend in found if len(trend.centres) > 1] or found  # one point shows no trend
    shown = [name for name in SHOWN if name not in validation.missing]
    for column, trend in enumerate(all_trends):
        for row, name in enumerate(shown):
            line = Line(trend.centres, trend.errors[:, FIELDS.index(name)], marker="circle")
            label = f"{name} [{UNITS[name]}]" if column == 0 else ""
            low = trend.label if row == len(shown) - 1 else ""
            panels.append(Panel((line,), label, low, row=row, column=column, timed=False))
    caption = f"Mean absolute error after {after:.3g} s by the state at the start of the window."
    return Plot(tuple(panels), caption, 2.0 * len(shown), (1.0,) * len(shown), (1.0,) * max(len(all_trends), 1))


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
