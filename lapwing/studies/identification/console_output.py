"""Terminal tables of `lapwing identify`."""

from pathlib import Path

import numpy as np
from rich.console import Console

from lapwing.studies import json_file
from lapwing.studies.identification.procedure import Identification
from lapwing.studies.terminal import counted, table
from lapwing.studies.validation.console_output import UNITS
from lapwing.studies.validation.prediction_metrics import FIELDS

CORRELATED = 0.8  # correlation of two estimates above which it is printed


def show(console: Console, identification: Identification) -> None:
    """Print estimates, correlations, undetermined parameters, and the errors on held-out flights."""
    fit = identification.fit
    title = f"{identification.scene}: output error on {counted(len(identification.used), 'flight')}"
    rows = table("parameter", "before", "estimate", "standard error", title=title)
    for key, before, value, error in zip(fit.keys, fit.start, fit.values, fit.standard_errors, strict=True):
        rows.add_row(key, f"{before:.5g}", f"{value:.5g}", f"{error:.2g}")
    console.print(rows)
    for line in identification.skipped:
        console.print(f"left out: {line}", soft_wrap=True)
    for i, j in zip(*np.triu_indices(len(fit.keys), 1), strict=True):
        if abs(fit.correlations[i, j]) > CORRELATED:
            text = f"correlated: {fit.keys[i]} and {fit.keys[j]}: {fit.correlations[i, j]:+.2f}"
            console.print(text, soft_wrap=True)
    for key in fit.undetermined:
        console.print(f"not determined by these flights: {key}", soft_wrap=True)
    held_out = len(identification.held_out)
    test_flights = counted(held_out, "held-out flight") if held_out else "the same flights"
    console.print(f"error after 0.5 s on {test_flights}, before and after:")
    for name, before, after in zip(FIELDS, identification.before, identification.after, strict=True):
        if np.isfinite(before):  # measured by a held-out flight
            console.print(f"  {name.replace('_', ' ')} [{UNITS[name]}]: {before:.3g}, {after:.3g}")


def write_json(path: Path, identification: Identification) -> None:
    """Write estimates, standard errors, correlations and errors."""
    fit = identification.fit
    rows = zip(fit.keys, fit.start, fit.values, fit.standard_errors, strict=True)
    errors = zip(FIELDS, identification.before, identification.after, strict=True)
    content = {
        "scene": identification.scene,
        "parameters": {
            key: {"start": a, "estimate": b, "standard_error": c, "determined": key not in fit.undetermined}
            for key, a, b, c in rows
        },
        "correlations": fit.correlations,
        "loss": fit.cost,
        "flights": identification.used,
        "held_out": identification.held_out,
        "left_out": identification.skipped,
        "held_out_errors": {name: {"before": a, "after": b} for name, a, b in errors},
    }
    json_file.write_json(path, content)
