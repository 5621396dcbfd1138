"""Plots of a campaign's report."""

import re
from typing import Any

import numpy as np

from lapwing.studies.battery_use import WATT_HOUR
from lapwing.studies.campaign.results import Results
from lapwing.studies.campaign.statistics import ellipse, has_sobol, interval, rank_correlation, sobol
from lapwing.studies.campaign.varied_parameters import (
    TARGETS,
    bins,
    strongest_parameters,
    texts_of,
    varied_parameters,
    with_unit,
)
from lapwing.studies.metrics import METRICS
from lapwing.studies.report.plot import Band, Line, Mark, NotRecordedError, Panel, Plot, Stretch
from lapwing.studies.report.style import AXIS_COLOURS, BOUND, COLOURS, FLOWN, QUIET, REFERENCE
from lapwing.studies.tracking import DEGREE

COLUMNS = 3  # panels in a row
MAX_LINES = 300  # runs drawn as lines over all parameters
LABEL_LENGTH = 12  # characters in a line of an axis label
SOBOL_MIN_RUNS, SOBOL_MAX_RUNS = 50, 10_000  # runs for Sobol indices
_LIMIT = re.compile(r"([\w.]+)\s*(?:<=?|>=?)\s*([-+\d.eE]+)")


def label_and_factor(name: str) -> tuple[str, float]:
    """Return label and unit factor of a metric: angles in degrees, energies in W h, fractions in per cent."""
    unit = METRICS[name]
    if unit == "J":
        return f"{name} [W h]", 1.0 / WATT_HOUR
    if unit == "rad":
        return f"{name} [°]", 1.0 / DEGREE
    if name.startswith(("nees", "nis")):  # not fractions: expected 9 and 1
        return name, 1.0
    return (f"{name} [{unit}]", 1.0) if unit else (f"{name} [%]", 100.0)


def required_limits(results: Results) -> dict[str, float]:
    """Return the limits of metrics in the scene's `[success]`."""
    texts = results.folder.about["success"]
    return {match[1]: float(match[2]) for text in texts if (match := _LIMIT.fullmatch(text.strip()))}


def errors(results: Results) -> Plot:
    """Plot root-mean-square errors with the published values."""
    caption = "Share of runs with a smaller root-mean-square error between reference and ground truth."
    return _distributions(results, [name for name in results.figures if name.startswith("rmse.")], caption)


def others(results: Results) -> Plot:
    """Plot all other metrics that differ between runs."""
    names = [name for name in results.figures if not name.startswith("rmse")]
    return _distributions(results, names, "Share of runs with a smaller value.")


def _distributions(results: Results, names: list[str], caption: str) -> Plot:
    if not names:
        raise NotRecordedError("equal in all runs")
    limits, panels = required_limits(results), []
    for k, name in enumerate(names):
        label, scale = label_and_factor(name)
        marks: list[Mark] = []
        for legend, column, colour in _by_vehicle(results, name):
            values = scale * np.sort(column[np.isfinite(column)])
            marks.append(Line(values, np.arange(1, len(values) + 1) / len(values), legend, colour))
        if name in results.published:
            marks.append(_vertical_line(scale * results.published[name], results.source, REFERENCE))
        if name in limits:
            marks.append(_vertical_line(scale * limits[name], "required", BOUND))
        position: dict[str, Any] = {"row": k // COLUMNS, "column": k % COLUMNS}
        panels.append(Panel(tuple(marks), "share" if k % COLUMNS == 0 else "", label, timed=False, **position))
    return _grid(panels, caption)


def _by_vehicle(results: Results, name: str) -> list[tuple[str, np.ndarray, str]]:
    """Return (legend, metric of the runs, colour) of each vehicle of a fleet; of the run for one or many vehicles."""
    by_vehicle = results.of_vehicles(name)
    if not 0 < len(by_vehicle) <= len(COLOURS):
        return [("worst vehicle of each run" if by_vehicle else "runs", results[name], FLOWN)]
    return [(vehicle, by_vehicle[vehicle], colour) for vehicle, colour in zip(by_vehicle, COLOURS, strict=False)]


def touchdown(results: Results) -> Plot:
    """Plot the touchdown points, for a single vehicle with the ellipses of a normal distribution."""
    if results.vehicles:
        return _fleet_touchdown(results)
    points = np.column_stack([results["touchdown.x"], results["touchdown.y"]])
    is_success = results["success"].astype(bool)[np.isfinite(points).all(axis=1)]
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) < 3:
        raise NotRecordedError("fewer than three runs with a touchdown")
    if not np.ptp(points, axis=0).any():
        raise NotRecordedError("all touchdowns are at the same point")
    marks = [_points(points[is_success], "success", FLOWN), _points(points[~is_success], "failure", BOUND)]
    for share, dash in ((0.5, "dash"), (0.95, "solid")):
        x, y = ellipse(points, share).T
        marks.append(Line(x, y, f"{share:.0%} of a normal distribution", REFERENCE, 1.1, dash))
    half_radius = np.median(np.linalg.norm(points - points.mean(axis=0), axis=1))
    (x, y), (dx, dy) = points.mean(axis=0), points.std(axis=0, ddof=1)
    caption = (
        f"Last touchdown of {len(points)} runs: mean ({x:.3g}, {y:.3g}) m, standard deviation "
        f"{dx:.2g} m along x and {dy:.2g} m along y; half of the points within {half_radius:.2g} m of the mean."
    )
    marks_with_points = tuple(mark for mark in marks if len(mark.x))
    return Plot((Panel(marks_with_points, "y [m]", "x [m]", timed=False, equal=True),), caption, 5.0)


def _fleet_touchdown(results: Results) -> Plot:
    """Plot the touchdown points of each vehicle of a fleet."""
    marks = []
    for (vehicle, x, colour), (_, y, _) in zip(
        _by_vehicle(results, "touchdown.x"), _by_vehicle(results, "touchdown.y"), strict=True
    ):
        is_finite = np.isfinite(x) & np.isfinite(y)
        if is_finite.any():
            marks.append(_points(np.column_stack([x, y])[is_finite], vehicle, colour))
    if not marks:
        raise NotRecordedError("no vehicle touches down, or the fleet has too many vehicles to distinguish")
    panel = Panel(tuple(marks), "y [m]", "x [m]", timed=False, equal=True)
    return Plot((panel,), "Last touchdown of each vehicle in each run.", 5.0)


def success(results: Results) -> Plot:
    """Plot the probability of success over each parameter."""
    panels, is_success = [], results["success"].astype(bool)
    keys, rest = strongest_parameters(results)
    for k, key in enumerate(keys):
        x, middles, groups = results.number(key), [], []
        for in_bin in bins(x):
            middles.append(float(x[in_bin].mean()))
            groups.append(interval(int(is_success[in_bin].sum()), int(in_bin.sum())))
        at, rows = np.array(middles), np.array(groups).T
        marks: tuple[Mark, ...] = (
            Band(at, rows[1], rows[2], "95 % interval", FLOWN),
            Line(at, rows[0], "successes", marker="circle"),
        )
        label = "probability of success" if k % COLUMNS == 0 else ""
        position: dict[str, Any] = {"row": k // COLUMNS, "column": k % COLUMNS, "y_range": (-0.02, 1.02)}
        panels.append(
            Panel(marks, label, with_unit(results, key), x_ticks=texts_of(results, key), timed=False, **position)
        )
    caption = "Share of successes in intervals of each parameter with equal numbers of runs."
    return _grid(panels, caption + rest)


def sensitivity(results: Results) -> Plot:
    """Plot sensitivities: rank correlations, and Sobol indices if SALib is installed.

    Bars whose 95 % interval contains 0 are grey: chance explains them.
    """
    keys = varied_parameters(results)
    targets = ["success"] if np.ptp(results["success"].astype(float)) > 0.0 else []
    targets += [name for name in TARGETS if name in results.figures]
    if not targets:
        raise NotRecordedError("equal results in all runs")
    x = np.column_stack([results.number(key) for key in keys])
    independent = not results.folder.plan.sweep  # required for Sobol indices
    with_sobol = has_sobol() and len(x) >= SOBOL_MIN_RUNS and independent
    kinds = ["rank correlation", *(["first-order Sobol index"] if with_sobol else [])]
    panels = []
    for row, target in enumerate(targets):
        y = results[target].astype(float)
        is_finite = np.isfinite(y)
        correlations = [rank_correlation(x[is_finite, k], y[is_finite]) for k in range(len(keys))]
        selected = np.flatnonzero(is_finite)[_random_subset(is_finite.sum(), SOBOL_MAX_RUNS)]
        indices = sobol(x[selected], y[selected], keys) if with_sobol and len(selected) >= SOBOL_MIN_RUNS else []
        for column, values in enumerate([correlations, indices][: len(kinds)]):
            bars = tuple(
                Stretch(key, 0.0, v.value, f"{v.value:.2f}", QUIET if v.low <= 0.0 <= v.high else AXIS_COLOURS[column])
                for key, v in zip(keys, values, strict=True)
                if np.isfinite(v.value)
            )
            position: dict[str, Any] = {
                "row": row,
                "column": column,
                "x_range": (-1.05, 1.05) if column == 0 else (-0.05, 1.05),
            }
            panels.append(Panel(bars, "", kinds[column], title=target, timed=False, **position))
    caption = f"Spearman's rank correlation of each parameter with the results of {len(x)} runs"
    caption += (
        ", and the share of the variance explained by the parameter alone (SALib, RBD-FAST)."
        if with_sobol
        else f". Sobol indices need {SOBOL_MIN_RUNS} runs and SALib: pip install lapwing[campaign]."
        if independent
        else ". Sobol indices need independent parameters, unlike those of a sweep."
    )
    caption += " Grey: not distinguishable from 0, because the 95 % interval contains it."
    height = len(targets) * (1.1 + 0.26 * len(keys)) + 0.6
    return Plot(tuple(panels), caption, height, (1.0,) * len(targets), (1.0,) * len(kinds))


def parallel(results: Results) -> Plot:
    """Plot every run as a line over all parameters and target metrics, each scaled to its range."""
    keys, rest = strongest_parameters(results)
    names = [*keys, *(name for name in TARGETS if name in results.figures)]
    if len(names) < 2:
        raise NotRecordedError("only one parameter varies")
    columns, ticks = [], []
    for name in names:
        values = results.number(name)
        label, scale = label_and_factor(name) if name in METRICS else (with_unit(results, name), 1.0)
        low, high = np.nanmin(values), np.nanmax(values)
        columns.append((values - low) / (high - low if high > low else 1.0))
        texts = texts_of(results, name)
        ends = (texts[0], texts[-1]) if texts else (f"{scale * low:.3g}", f"{scale * high:.3g}")
        ticks.append(f"{_break_key(label)}\n{ends[0]}\nto {ends[1]}")
    rows, is_success = np.column_stack(columns), results["success"].astype(bool)
    marks = []
    for name, selected, colour in (("success", is_success, QUIET), ("failure", ~is_success, BOUND)):
        if selected.any():
            lines = rows[selected][_random_subset(selected.sum(), MAX_LINES)]
            broken = np.column_stack([lines, np.full(len(lines), np.nan)])
            x = np.tile(np.append(np.arange(len(names), dtype=float), np.nan), len(lines))
            marks.append(Line(x, broken.ravel(), name, colour, 0.7))
    limits: dict[str, Any] = {"x_range": (-0.5, len(names) - 0.5), "y_range": (-0.03, 1.03)}
    panel = Panel(tuple(marks), "position in the range", timed=False, x_ticks=tuple(ticks), **limits)
    caption = f"A line for each run, at most {MAX_LINES} successes and {MAX_LINES} failures."
    return Plot((panel,), caption + rest, 4.2)


def _random_subset(n: int, most: int) -> np.ndarray:
    """Return at most `most` random indices of n runs; regular indices could match the steps of a grid."""
    return np.arange(n) if n <= most else np.sort(np.random.default_rng(1).choice(n, most, replace=False))


def _break_key(key: str) -> str:
    """Break a dotted key into several lines."""
    lines = [""]
    for part in re.findall(r"\[[^\]]*\]|[^.\[]+\.?", key):
        if len(lines[-1] + part) > LABEL_LENGTH and lines[-1]:
            lines.append("")
        lines[-1] += part
    return "\n".join(lines)


def _points(points: np.ndarray, name: str, colour: str) -> Line:
    return Line(points[:, 0], points[:, 1], name, colour, marker="circle", size=3.0, joined=False)


def _vertical_line(x: float, name: str, colour: str) -> Line:
    return Line(np.array([x, x]), np.array([0.0, 1.0]), name, colour, 1.1, "dash")


def _grid(panels: list[Panel], caption: str) -> Plot:
    rows = -(-len(panels) // COLUMNS)
    return Plot(tuple(panels), caption, 0.9 + 2.3 * rows, (1.0,) * rows, (1.0,) * min(len(panels), COLUMNS))
