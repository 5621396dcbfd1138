"""Plots of a campaign's report."""

import textwrap
from collections.abc import Iterator
from typing import Any

import numpy as np

from lapwing.flights.battery_use import WATT_HOUR
from lapwing.flights.metrics import METRICS
from lapwing.flights.tracking import DEGREE
from lapwing.studies.campaign.results import Results
from lapwing.studies.campaign.statistics import ellipse, groups, interval, percent
from lapwing.studies.campaign.verdict import ANY, MIN_RUNS, criteria, drivers, subject
from lapwing.studies.campaign.verdict import varied_parameters as all_varied
from lapwing.views.report.plot import Band, Line, Mark, NotRecordedError, Panel, Plot, Stretch
from lapwing.views.report.style import AXIS_COLOURS, BOUND, COLOURS, FLOWN, QUIET, REFERENCE

COLUMNS = 3  # panels in a row
BINS = 10  # intervals of a parameter
MARGIN = 0.04  # of the range of a distribution, on both sides
LANE = 28  # characters in a line of a criterion


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


def criteria_plot(results: Results) -> Plot:
    """Plot the share of the runs that fail each criterion, and the distribution of the deciding metric."""
    rows = criteria(results)
    if not rows:
        raise NotRecordedError("the scene requires nothing")
    bars = []
    for row in rows:
        share = 100.0 * row.failures / len(results)
        label = "\n".join(textwrap.wrap(f"{row.text}: {row.failures}", LANE))
        bars.append(Stretch(label, 0.0, share, "", BOUND))
    largest = 100.0 * results.failure.value
    any_text = "\n".join(textwrap.wrap(f"any: {percent(results.failure)}", LANE))
    bars.append(Stretch(any_text, 0.0, largest, "", BOUND))
    shares = Panel(tuple(bars), "", "runs that fail [%]", timed=False, x_range=(0.0, min(100.0, 1.2 * largest + 1.0)))
    metric = subject(results)
    caption = f"Runs that miss each criterion, of {len(results)}."
    if metric == ANY or metric not in results.figures:
        if largest == 0.0:
            raise NotRecordedError("no run fails")
        return Plot((shares,), caption, 0.9 + 0.4 * len(bars))
    caption += f" Curve: share of runs with a smaller {metric}, which decides most failures or is nearest to its limit."
    (panel,) = _distributions(results, [metric], "").panels
    both = (shares, panel._replace(column=1, y_label="share of runs"))
    return Plot(both, caption, max(3.2, 0.9 + 0.4 * len(bars)), widths=(1.0, 1.0))


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
    limits, panels = {row.metric: row.limit for row in criteria(results) if row.metric}, []
    for k, name in enumerate(names):
        label, scale = label_and_factor(name)
        marks: list[Line] = []
        for legend, column, colour in _by_vehicle(results, name):
            values = scale * np.sort(column[np.isfinite(column)])
            marks.append(Line(values, np.arange(1, len(values) + 1) / len(values), legend, colour))
        if name in results.published:
            marks.append(_vertical_line(scale * results.published[name], results.source, REFERENCE))
        if name in limits:
            marks.append(_vertical_line(scale * limits[name], "required", BOUND))
        place: dict[str, Any] = {"row": k // COLUMNS, "column": k % COLUMNS, "x_range": _with_margin(marks)}
        panels.append(Panel(tuple(marks), "share" if k % COLUMNS == 0 else "", label, timed=False, **place))
    return _grid(panels, caption)


def _with_margin(marks: list[Line]) -> tuple[float, float] | None:
    """Return the range of lines with a margin, so that none lies on the edge; None where all are at one value."""
    x = np.concatenate([line.x for line in marks])
    low, high = float(x.min()), float(x.max())
    return (low - MARGIN * (high - low), high + MARGIN * (high - low)) if high > low else None


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
        marks.append(Line(x, y, f"{100.0 * share:.0f} % of a normal distribution", REFERENCE, 1.1, dash))
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
    """Plot the probability of success over each parameter, the strongest influence first."""
    panels, is_success = [], results["success"].astype(bool)
    varied_parameters(results)
    keys = [driver.key for driver in drivers(results, subject(results))]
    for k, key in enumerate(keys[:MAX_KEYS]):
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
    if omitted := keys[MAX_KEYS:]:
        caption += f" Omitted, because their influence is weakest: {', '.join(omitted)}."
    return _grid(panels, caption)


def sensitivity(results: Results) -> Plot:
    """Plot rank correlations, and shares of the variance if the parameters are independent.

    Bars whose 95 % interval contains 0 are grey: chance explains them.
    """
    keys = varied_parameters(results)
    varying = [ANY] if np.ptp(results[ANY].astype(float)) > 0.0 else []
    varying += results.figures
    targets = [name for name in dict.fromkeys((subject(results), ANY, *TARGETS)) if name in varying]
    if not targets:
        raise NotRecordedError("equal results in all runs")
    independent = not results.folder.plan.sweep
    kinds = ["rank correlation", *(["share of the variance"] if independent and len(results) >= MIN_RUNS else [])]
    panels = []
    for row, target in enumerate(targets):
        by_key = {driver.key: driver for driver in drivers(results, target)}
        for column, kind in enumerate(kinds):
            values = {key: by_key[key].share if column else by_key[key].correlation for key in keys}
            bars = tuple(
                Stretch(key, 0.0, v.value, f"{v.value:z.2f}", QUIET if v.low <= 0.0 <= v.high else AXIS_COLOURS[column])
                for key, v in values.items()
                if np.isfinite(v.value)
            )
            x_range = (-0.05, 1.05) if column else (-1.05, 1.05)
            panels.append(Panel(bars, "", kind, title=target, timed=False, row=row, column=column, x_range=x_range))
    caption = f"Spearman's rank correlation of each parameter with the results of {len(results)} runs"
    caption += (
        ", and the share of the variance that the parameter explains alone (first-order Sobol index)."
        if len(kinds) == 2
        else f". Shares of the variance need {MIN_RUNS} runs."
        if independent
        else ". Shares of the variance need independent parameters, unlike those of a sweep."
    )
    caption += " Grey: not distinguishable from 0, because the interval contains it (95 % for all parameters together)."
    height = len(targets) * (1.1 + 0.26 * len(keys)) + 0.6
    return Plot(tuple(panels), caption, height, (1.0,) * len(targets), (1.0,) * len(kinds))


def _points(points: np.ndarray, name: str, colour: str) -> Line:
    return Line(points[:, 0], points[:, 1], name, colour, marker="circle", size=3.0, joined=False)


def _vertical_line(x: float, name: str, colour: str) -> Line:
    return Line(np.array([x, x]), np.array([0.0, 1.0]), name, colour, 1.1, "dash")


def _grid(panels: list[Panel], caption: str) -> Plot:
    rows = -(-len(panels) // COLUMNS)
    return Plot(tuple(panels), caption, 0.9 + 2.3 * rows, (1.0,) * rows, (1.0,) * min(len(panels), COLUMNS))


MAX_KEYS = 9  # parameters with a panel
TARGETS = ("max_distance", "touchdown.speed", "energy")  # metrics for sensitivities, in addition to success


def varied_parameters(results: Results) -> list[str]:
    """Return the parameters that differ between the runs."""
    if not (keys := all_varied(results)):
        raise NotRecordedError("no parameter varies; use --vary KEY=DISTRIBUTION")
    return keys


def bins(x: np.ndarray) -> Iterator[np.ndarray]:
    """Yield a mask of the runs, shape (n,), for each value of a parameter or each interval with equal counts."""
    index = groups(x, BINS)
    yield from (index == k for k in np.unique(index))


def with_unit(results: Results, key: str) -> str:
    """Return a parameter's key with its unit if known."""
    unit = results.units.get(key, "")
    return f"{key} [{unit}]" if unit else key


def texts_of(results: Results, name: str) -> tuple[str, ...]:
    """Return the values of a text parameter in the order of their indices; () for numbers."""
    return tuple(np.unique(results[name])) if results[name].dtype == object else ()
