"""Results of a campaign as tables and as JSON."""

import math
from collections.abc import Sequence
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console

from lapwing.studies import json_file
from lapwing.studies.campaign.fleet_columns import NEAREST
from lapwing.studies.campaign.results import Results
from lapwing.studies.consistency import JOINT, SOURCES, bounds
from lapwing.studies.terminal import table
from lapwing.studies.tracking import AXES, unit_and_factor

VEHICLE_FIGURES = ("rmse.x", "rmse.y", "rmse.z", "max_distance", "touchdown.speed")
VEHICLE_COLUMNS = ("x [m]", "y [m]", "z [m]", "farthest [m]", "touchdown [m/s]", "success")
VEHICLES = "Worst run and success rate of each vehicle"
# a terminal of 80 columns shows all columns
NARROW: dict[str, Any] = {"box": SIMPLE_HEAD, "show_edge": False, "pad_edge": False, "padding": 0}
LISTED = 10  # failures and rejected runs


def show(console: Console, results: Results) -> None:
    """Print the tables and the failure probability."""
    if len(results) == 0:
        console.print(f"{results.scene}: the scene rejected every run")
        _list(console, "rejected", results.rejected["run"], results.rejected["outcome_text"])
        return
    _table(console, "Root-mean-square error between reference and ground truth", "rmse", results)
    if results.on_estimate:
        _table(console, "Root-mean-square error between reference and estimate", "rmse_estimate", results)
        least = {axis: results.spread(f"within_3sigma.{axis}") for axis in "xyz"}
        text = ", ".join(f"{axis} {s.worst:.1%} (run {s.run})" for axis, s in least.items() if s)
        if text:  # a foreign firmware reports no standard deviations
            shares = ", ".join(f"{axis} {results[f'within_3sigma.{axis}'].mean():.2%}" for axis in "xyz")
            console.print(f"Ground truth within 3 sigma of the estimate: {shares} of the time")
            console.print(f"Lowest share of a flight: {text}")
        for line in consistency_lines(results):
            console.print(line)
    if results.vehicles:
        _vehicles(console, results)
    if len(results) > 1 and not results.figures:
        console.print("All runs are equal: the scene has no random numbers, and no key varies")
    runs = len(results) + len(results.rejected["run"])
    console.print(f"{results.scene}: {runs} runs: {results.outcome_text}")
    p, failed = results.failure, ~results["success"].astype(bool)
    share = f"{p.value:.2%} of the flights, 95 % interval {p.low:.2%} to {p.high:.2%}"
    criteria = " and ".join(results.folder.about["success"]) or "always"
    style = "bold red" if failed.any() else "bold green"
    console.print(f"Failures: {share} (success: {criteria})", style=style, markup=False)
    if (farthest := results.spread("target_distance")) and failed.any():
        text = f"median {farthest.median:.1f} m, worst {farthest.worst:.1f} m (run {farthest.run})"
        console.print(f"Final distance from the mission's target: {text}")
    _list(console, "run", results["run"][failed], results["outcome_text"][failed])
    _list(console, "rejected: run", results.rejected["run"], results.rejected["outcome_text"])


def consistency_lines(results: Results) -> list[str]:
    """Return the joint NEES and the NIS over all runs with their 95 % bounds; [] without a covariance."""
    finite = results["nees"][np.isfinite(results["nees"])]
    if not len(finite):
        return []
    low, high = bounds(JOINT, len(finite))
    share = np.nanmean(results["within_95.nees"])
    samples = int(np.nansum(results["nis_samples"]))
    innovations = []
    for source, (_, dimension) in SOURCES.items():
        if np.isfinite(results[f"nis.{source}"]).any():
            least, most = (bound / dimension for bound in bounds(dimension, samples))
            innovations.append(f"{source} {np.nanmean(results[f'nis.{source}']):.3f} ({least:.3f} to {most:.3f})")
    return [
        f"Joint NEES of attitude, velocity, position: {finite.mean():.2f}, expected {JOINT}, 95 % bounds {low:.2f} to "
        f"{high:.2f}; within its 95 % quantile {share:.1%} of the time",
        f"NIS by dimension, expected 1 (95 % bounds): {', '.join(innovations)}",
    ]


def _vehicles(console: Console, results: Results) -> None:
    rows = table("vehicle", *VEHICLE_COLUMNS, title=VEHICLES, **NARROW)
    for vehicle, cells in vehicle_cells(results).items():
        rows.add_row(vehicle, *cells)
    console.print(rows)
    console.print(f"Smallest separation of two vehicles: {nearest_of(results)}")


def vehicle_cells(results: Results) -> dict[str, list[str]]:
    """Return the cells of `VEHICLE_COLUMNS` for each vehicle of a fleet."""
    cells = {}
    for vehicle in results.vehicles:
        spreads = [results.spread(f"{vehicle}.{name}") for name in VEHICLE_FIGURES]
        share = f"{results[f'{vehicle}.success'].astype(bool).mean():.1%}"
        cells[vehicle] = [*(f"{s.worst:.4f}" if s else "" for s in spreads), share]
    return cells


def nearest_of(results: Results) -> str:
    """Return the smallest separation of two vehicles of a fleet as text."""
    least = results.spread(NEAREST)
    if least is None:
        return "unknown"
    return f"{least.worst:.2f} m (run {least.run}), median {least.median:.2f} m"


def _list(console: Console, label: str, runs: Sequence[int], texts: Sequence[str]) -> None:
    for run, text in list(zip(runs, texts, strict=True))[:LISTED]:
        console.print(f"  {label} {run}: {text}")
    if len(runs) > LISTED:
        console.print(f"  and {len(runs) - LISTED} more; see the table of runs")


def _table(console: Console, title: str, kind: str, results: Results) -> None:
    published_heads = ("\n".join(wrap(results.source, 10)), "worst /\npublished") if results.published else ()
    rows = table("axis", "5 %", "median", "95 %", "worst", "in run", *published_heads, title=title, **NARROW)
    for axis in AXES:
        s, (unit, scale) = results.spread(f"{kind}.{axis}"), unit_and_factor(axis)
        if s is None:
            continue
        row = [f"{axis} [{unit}]", *(digits(scale * v) for v in (s.low, s.median, s.high, s.worst)), str(s.run)]
        if published := results.published.get(f"rmse.{axis}"):
            row += [digits(scale * published), f"{s.worst / published:.3f}"]
        rows.add_row(*row)
    if rows.row_count:  # empty without a reference, as for a flight plan
        console.print(rows)


def digits(value: float) -> str:
    """Return a number with three significant digits and at least four decimals: 1.2345, 0.000214."""
    decimals = 4 if value == 0.0 or abs(value) >= 1e-2 else min(2 - math.floor(math.log10(abs(value))), 9)
    return f"{value:.{decimals}f}"


def write_json(path: Path, results: Results, digest: str) -> None:
    """Write the results of the campaign without its single runs."""
    spreads = {name: results.spread(name) for name in results.figures}
    data = {
        "scene": results.scene,
        "runs": len(results) + len(results.rejected["run"]),
        "outcome_text": results.outcome_text,
        "failure": results.failure,
        "figures": {name: s for name, s in spreads.items() if s},
        "failed": results["run"][~results["success"].astype(bool)],
        "rejected": results.rejected["run"],
        "digest": digest,
    }
    json_file.write_json(path, data)
