"""A campaign in the terminal, and as JSON."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from lapwing.studies import json_file
from lapwing.studies.campaign.fleet_columns import NEAREST
from lapwing.studies.campaign.results import Results
from lapwing.studies.consistency import JOINT, SOURCES, bounds
from lapwing.studies.tracking import AXES, shown

VEHICLE_FIGURES = ("rmse.x", "rmse.y", "rmse.z", "max_distance", "touchdown.speed")
VEHICLE_COLUMNS = ("x [m]", "y [m]", "z [m]", "farthest [m]", "touch-down [m/s]", "success")
VEHICLES = "The vehicles: worst run of each, and in how many runs it did not fail"
LISTED = 10  # failures, refusals


def show(console: Console, found: Results) -> None:
    """Print the campaign for people."""
    if len(found) == 0:
        console.print(f"{found.scene}: the scene rejected every run")
        _list(console, "rejected", found.refused["run"], found.refused["outcome_text"])
        return
    _table(console, "Root-mean-square error of the reference against the truth", "rmse", found)
    if found.on_estimate:
        _table(console, "The same against the vehicle's own estimate", "rmse_estimate", found)
        shares = ", ".join(f"{axis} {found[f'within_3sigma.{axis}'].mean():.2%}" for axis in "xyz")
        console.print(f"Truth within 3 sigma of the estimate: {shares} of the time")
        least = {axis: found.spread(f"within_3sigma.{axis}") for axis in "xyz"}
        text = ", ".join(f"{axis} {s.worst:.1%} (run {s.run})" for axis, s in least.items() if s)
        console.print(f"Least of a flight: {text}")
        for line in consistency_lines(found):
            console.print(line)
    if found.vehicles:
        _vehicles(console, found)
    if len(found) > 1 and not found.figures:
        console.print("Every run is the same flight: nothing in this scene is random, and nothing varies")
    runs = len(found) + len(found.refused["run"])
    console.print(f"{found.scene}: {runs} runs: {found.outcome_text}")
    p, failed = found.failure, ~found["success"].astype(bool)
    share = f"{p.value:.2%} of the flights, 95 % interval {p.low:.2%} to {p.high:.2%}"
    criteria = " and ".join(found.folder.about["success"]) or "always"
    style = "bold red" if failed.any() else "bold green"
    console.print(f"Failures: {share} (success: {criteria})", style=style, markup=False)
    if (farthest := found.spread("target_distance")) and failed.any():
        text = f"median {farthest.median:.1f} m, worst {farthest.worst:.1f} m (run {farthest.run})"
        console.print(f"Distance from the mission's target at the end: {text}")
    _list(console, "run", found["run"][failed], found["outcome_text"][failed])
    _list(console, "rejected: run", found.refused["run"], found.refused["outcome_text"])


def consistency_lines(found: Results) -> list[str]:
    """Return the joint NEES and the NIS over all runs with their 95 % bounds; [] without a covariance."""
    known = found["nees"][np.isfinite(found["nees"])]
    if not len(known):
        return []
    low, high = bounds(JOINT, len(known))
    share = np.nanmean(found["within_95.nees"])
    samples = int(np.nansum(found["nis_samples"]))
    innovations = []
    for source, (_, dimension) in SOURCES.items():
        if np.isfinite(found[f"nis.{source}"]).any():
            least, most = (bound / dimension for bound in bounds(dimension, samples))
            innovations.append(f"{source} {np.nanmean(found[f'nis.{source}']):.3f} ({least:.3f} to {most:.3f})")
    return [
        f"Joint NEES of attitude, velocity, position: {known.mean():.2f}, expected {JOINT}, 95 % bounds {low:.2f} to "
        f"{high:.2f}; within its 95 % quantile {share:.1%} of the time",
        f"NIS by dimension, expected 1 (95 % bounds): {', '.join(innovations)}",
    ]


def _vehicles(console: Console, found: Results) -> None:
    table = Table(title=VEHICLES, title_justify="left")
    table.add_column("vehicle", no_wrap=True)
    for column in VEHICLE_COLUMNS:
        table.add_column(column, justify="right", no_wrap=True)
    for vehicle, cells in vehicle_cells(found).items():
        table.add_row(vehicle, *cells)
    console.print(table)
    console.print(f"Nearest of any two vehicles: {nearest_of(found)}")


def vehicle_cells(found: Results) -> dict[str, list[str]]:
    """Return the cells of `VEHICLE_COLUMNS` for each vehicle of a fleet."""
    return {vehicle: _cells(found, vehicle) for vehicle in found.vehicles}


def _cells(found: Results, vehicle: str) -> list[str]:
    spreads = [found.spread(f"{vehicle}.{name}") for name in VEHICLE_FIGURES]
    share = f"{found[f'{vehicle}.success'].astype(bool).mean():.1%}"
    return [*(f"{s.worst:.4f}" if s else "" for s in spreads), share]


def nearest_of(found: Results) -> str:
    """Return the least separation of two vehicles of a fleet as text."""
    least = found.spread(NEAREST)
    if least is None:
        return "unknown"
    return f"{least.worst:.2f} m apart (run {least.run}), in half of the runs below {least.median:.2f} m"


def _list(console: Console, what: str, runs: Sequence[int], told: Sequence[str]) -> None:
    for run, text in list(zip(runs, told, strict=True))[:LISTED]:
        console.print(f"  {what} {run}: {text}")
    if len(runs) > LISTED:
        console.print(f"  and {len(runs) - LISTED} more: the table has all of them")


def _table(console: Console, title: str, kind: str, found: Results) -> None:
    table = Table(title=title, title_justify="left")
    table.add_column("axis", no_wrap=True)
    for column in ("5 %", "median", "95 %", "worst", "in run"):
        table.add_column(column, justify="right", no_wrap=True)
    if found.published:
        table.add_column(found.source, justify="right")
        table.add_column("worst / that", justify="right")
    for axis in AXES:
        s, (unit, scale) = found.spread(f"{kind}.{axis}"), shown(axis)
        if s is None:
            continue
        row = [f"{axis} [{unit}]", *(digits(scale * v) for v in (s.low, s.median, s.high, s.worst)), str(s.run)]
        if published := found.published.get(f"rmse.{axis}"):
            row += [digits(scale * published), f"{s.worst / published:.3f}"]
        table.add_row(*row)
    if table.row_count:  # a flight plan is no reference
        console.print(table)


def digits(value: float) -> str:
    """Return a number with three significant digits and at least four decimals: 1.2345, 0.000214."""
    decimals = 4 if value == 0.0 or abs(value) >= 1e-2 else min(2 - math.floor(math.log10(abs(value))), 9)
    return f"{value:.{decimals}f}"


def write_json(path: Path, found: Results, digest: str) -> None:
    """Write the results of the campaign; the table has the single runs."""
    spreads = {name: found.spread(name) for name in found.figures}
    data = {
        "scene": found.scene,
        "runs": len(found) + len(found.refused["run"]),
        "outcome_text": found.outcome_text,
        "failure": found.failure,
        "figures": {name: s for name, s in spreads.items() if s},
        "failed": found["run"][~found["success"].astype(bool)],
        "refused": found.refused["run"],
        "digest": digest,
    }
    json_file.write_json(path, data)
