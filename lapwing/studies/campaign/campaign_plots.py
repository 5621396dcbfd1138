"""The plots of a campaign's report."""

import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from lapwing.studies.battery_use import WATT_HOUR
from lapwing.studies.campaign.results import Results
from lapwing.studies.campaign.statistics import ellipse, has_sobol, interval, rank_correlation, sobol
from lapwing.studies.metrics import METRICS
from lapwing.studies.report.plot import Band, Line, Mark, NotRecordedError, Panel, Plot, Stretch
from lapwing.studies.report.style import AXIS_COLOURS, BOUND, COLOURS, FLOWN, QUIET, REFERENCE
from lapwing.studies.tracking import DEGREE

ACROSS = 3  # panels beside each other
BINS = 10  # of a parameter
KEYS = 9  # parameters that have a panel each
MATTERS = ("max_distance", "touchdown.speed", "energy")  # what a parameter may matter for, besides success
PARALLEL = 300  # runs drawn as lines over all parameters
LETTERS = 12  # of a line below an axis
ENOUGH, MOST = 50, 10_000  # runs for Sobol indices: at least, and as many as are looked at
_LIMIT = re.compile(r"([\w.]+)\s*(?:<=?|>=?)\s*([-+\d.eE]+)")


def label_and_factor(name: str) -> tuple[str, float]:
    """Return label and unit factor of a metric as shown: angles in degrees, energies in W h, fractions in per cent."""
    unit = METRICS[name]
    if unit == "J":
        return f"{name} [W h]", 1.0 / WATT_HOUR
    if unit == "rad":
        return f"{name} [°]", 1.0 / DEGREE
    if name.startswith(("nees", "nis")):  # no shares: expected 9 and 1
        return name, 1.0
    return (f"{name} [{unit}]", 1.0) if unit else (f"{name} [%]", 100.0)


def required_limits(results: Results) -> dict[str, float]:
    """Return the limits of metrics in the scene's `[success]`."""
    texts = results.folder.about["success"]
    return {match[1]: float(match[2]) for text in texts if (match := _LIMIT.fullmatch(text.strip()))}


def errors(results: Results) -> Plot:
    """Plot root-mean-square errors with the published values."""
    caption = "Share of the runs with a smaller root-mean-square error of the reference against the truth."
    return _distributions(results, [name for name in results.figures if name.startswith("rmse.")], caption)


def others(results: Results) -> Plot:
    """Plot all other metrics that differ between runs."""
    names = [name for name in results.figures if not name.startswith("rmse")]
    return _distributions(results, names, "Share of the runs with a smaller value.")


def _distributions(results: Results, names: list[str], caption: str) -> Plot:
    if not names:
        raise NotRecordedError("every run has the same")
    limits, panels = required_limits(results), []
    for k, name in enumerate(names):
        label, scale = label_and_factor(name)
        marks: list[Mark] = []
        for legend, column, colour in _each(results, name):
            values = scale * np.sort(column[np.isfinite(column)])
            marks.append(Line(values, np.arange(1, len(values) + 1) / len(values), legend, colour))
        if name in results.published:
            marks.append(_upright(scale * results.published[name], results.source, REFERENCE))
        if name in limits:
            marks.append(_upright(scale * limits[name], "required", BOUND))
        place: dict[str, Any] = {"row": k // ACROSS, "column": k % ACROSS}
        panels.append(Panel(tuple(marks), "share" if k % ACROSS == 0 else "", label, timed=False, **place))
    return _grid(panels, caption)


def _each(results: Results, name: str) -> list[tuple[str, np.ndarray, str]]:
    """Return (legend, metric of the runs, colour) of each vehicle of a fleet; of the run for one or many vehicles."""
    own = results.of_vehicles(name)
    if not 0 < len(own) <= len(COLOURS):
        return [("the worst vehicles" if own else "runs", results[name], FLOWN)]
    return [(vehicle, own[vehicle], colour) for vehicle, colour in zip(own, COLOURS, strict=False)]


def touchdown(results: Results) -> Plot:
    """Plot the touch-down points; of one vehicle with the ellipses of a normal distribution."""
    if results.vehicles:
        return _touchdowns(results)
    points = np.column_stack([results["touchdown.x"], results["touchdown.y"]])
    good = results["success"].astype(bool)[np.isfinite(points).all(axis=1)]
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) < 3:
        raise NotRecordedError("fewer than three runs touch down")
    if not np.ptp(points, axis=0).any():
        raise NotRecordedError("every run touches down at the same place")
    marks = [_dots(points[good], "success", FLOWN), _dots(points[~good], "failure", BOUND)]
    for share, dash in ((0.5, "dash"), (0.95, "solid")):
        x, y = ellipse(points, share).T
        marks.append(Line(x, y, f"{share:.0%} of a normal distribution", REFERENCE, 1.1, dash))
    half = np.median(np.linalg.norm(points - points.mean(axis=0), axis=1))
    (x, y), (dx, dy) = points.mean(axis=0), points.std(axis=0, ddof=1)
    caption = (
        f"Last touch-down of {len(points)} runs: mean ({x:.3g}, {y:.3g}) m, standard deviation "
        f"{dx:.2g} m along x and {dy:.2g} m along y; half of them within {half:.2g} m of the mean."
    )
    drawn = tuple(mark for mark in marks if len(mark.x))
    return Plot((Panel(drawn, "y [m]", "x [m]", timed=False, equal=True),), caption, 5.0)


def _touchdowns(results: Results) -> Plot:
    """Plot the touch-down points of each vehicle of a fleet."""
    marks = []
    for (vehicle, x, colour), (_, y, _) in zip(
        _each(results, "touchdown.x"), _each(results, "touchdown.y"), strict=True
    ):
        there = np.isfinite(x) & np.isfinite(y)
        if there.any():
            marks.append(_dots(np.column_stack([x, y])[there], vehicle, colour))
    if not marks:
        raise NotRecordedError("no vehicle touches down, or there are too many to tell apart")
    panel = Panel(tuple(marks), "y [m]", "x [m]", timed=False, equal=True)
    return Plot((panel,), "Last touch-down of each vehicle in each run.", 5.0)


def success(results: Results) -> Plot:
    """Return the probability of success over each parameter."""
    panels, good = [], results["success"].astype(bool)
    keys, rest = _most(results)
    for k, key in enumerate(keys):
        x, middles, groups = results.number(key), [], []
        for inside in _bins(x):
            middles.append(float(x[inside].mean()))
            groups.append(interval(int(good[inside].sum()), int(inside.sum())))
        at, rows = np.array(middles), np.array(groups).T
        marks: tuple[Mark, ...] = (
            Band(at, rows[1], rows[2], "95 % interval", FLOWN),
            Line(at, rows[0], "successes", marker="circle"),
        )
        label = "probability of success" if k % ACROSS == 0 else ""
        place: dict[str, Any] = {"row": k // ACROSS, "column": k % ACROSS, "y_range": (-0.02, 1.02)}
        panels.append(Panel(marks, label, _with_unit(results, key), x_ticks=_texts(results, key), timed=False, **place))
    caption = "Share of successes among the runs of each part of a parameter's range, of equal counts."
    return _grid(panels, caption + rest)


def matters(results: Results) -> Plot:
    """Plot sensitivities: rank correlations, and Sobol indices if SALib is installed."""
    keys = _parameters(results)
    aims = ["success"] if np.ptp(results["success"].astype(float)) > 0.0 else []
    aims += [name for name in MATTERS if name in results.figures]
    if not aims:
        raise NotRecordedError("every run came to the same")
    x = np.column_stack([results.number(key) for key in keys])
    independent = not results.folder.plan.sweep  # which Sobol indices suppose
    with_sobol = has_sobol() and len(x) >= ENOUGH and independent
    kinds = ["rank correlation", *(["first-order Sobol index"] if with_sobol else [])]
    panels = []
    for row, aim in enumerate(aims):
        y = results[aim].astype(float)
        there = np.isfinite(y)
        correlated = [rank_correlation(x[there, k], y[there]) for k in range(len(keys))]
        chosen = np.flatnonzero(there)[_some(there.sum(), MOST)]
        indices = sobol(x[chosen], y[chosen], keys) if with_sobol and len(chosen) >= ENOUGH else []
        for column, values in enumerate([correlated, indices][: len(kinds)]):
            bars = tuple(
                Stretch(key, 0.0, v.value, f"{v.value:.2f}", AXIS_COLOURS[column])
                for key, v in zip(keys, values, strict=True)
                if np.isfinite(v.value)
            )
            place: dict[str, Any] = {
                "row": row,
                "column": column,
                "x_range": (-1.05, 1.05) if column == 0 else (-0.05, 1.05),
            }
            panels.append(Panel(bars, "", kinds[column], title=aim, timed=False, **place))
    caption = f"Spearman's rank correlation of each parameter with the results of {len(x)} runs"
    caption += (
        "; beside it the share of the variance that the parameter explains alone (SALib, RBD-FAST)."
        if with_sobol
        else f". Sobol indices need {ENOUGH} runs and SALib: pip install lapwing[campaign]."
        if independent
        else ". Sobol indices need parameters that are drawn independently, which those of a sweep are not."
    )
    height = len(aims) * (1.1 + 0.26 * len(keys)) + 0.6
    return Plot(tuple(panels), caption, height, (1.0,) * len(aims), (1.0,) * len(kinds))


def parallel(results: Results) -> Plot:
    """Return every run as a line over all parameters and what matters, each scaled to its range."""
    keys, rest = _most(results)
    names = [*keys, *(name for name in MATTERS if name in results.figures)]
    if len(names) < 2:
        raise NotRecordedError("only one parameter varies")
    columns, ticks = [], []
    for name in names:
        values, (label, scale) = (
            results.number(name),
            label_and_factor(name) if name in METRICS else (_with_unit(results, name), 1.0),
        )
        low, high = np.nanmin(values), np.nanmax(values)
        columns.append((values - low) / (high - low if high > low else 1.0))
        texts = _texts(results, name)
        ends = (texts[0], texts[-1]) if texts else (f"{scale * low:.3g}", f"{scale * high:.3g}")
        ticks.append(f"{_break_key(label)}\n{ends[0]}\nto {ends[1]}")
    rows, good = np.column_stack(columns), results["success"].astype(bool)
    marks = []
    for name, chosen, colour in (("success", good, QUIET), ("failure", ~good, BOUND)):
        if chosen.any():
            lines = rows[chosen][_some(chosen.sum(), PARALLEL)]
            broken = np.column_stack([lines, np.full(len(lines), np.nan)])
            x = np.tile(np.append(np.arange(len(names), dtype=float), np.nan), len(lines))
            marks.append(Line(x, broken.ravel(), name, colour, 0.7))
    limits: dict[str, Any] = {"x_range": (-0.5, len(names) - 0.5), "y_range": (-0.03, 1.03)}
    panel = Panel(tuple(marks), "place in the range", timed=False, x_ticks=tuple(ticks), **limits)
    caption = f"A line for each run, at most {PARALLEL} successes and {PARALLEL} failures."
    return Plot((panel,), caption + rest, 4.2)


def _some(n: int, most: int) -> np.ndarray:
    """Return the indices of at most so many of n runs, at random, since every k-th could match the steps of a grid."""
    return np.arange(n) if n <= most else np.sort(np.random.default_rng(1).choice(n, most, replace=False))


def _parameters(results: Results) -> list[str]:
    """Return the parameters that differ between the runs."""
    keys = [key for key in results.folder.plan.keys if len(np.unique(results[key])) > 1]
    if not keys:
        raise NotRecordedError("no parameter varies; --vary KEY=DISTRIBUTION lets one")
    return keys


def _most(results: Results) -> tuple[list[str], str]:
    """Return the parameters with the strongest correlations, as many as panels, and a text on the others."""
    keys = _parameters(results)
    if len(keys) <= KEYS:
        return keys, ""
    aims = [
        results[name].astype(float) for name in ("success", *MATTERS) if name == "success" or name in results.figures
    ]

    def strength(key: str) -> float:
        x = results.number(key)
        every = (abs(rank_correlation(x[there], y[there]).value) for y in aims if (there := np.isfinite(y)).any())
        return max((value for value in every if np.isfinite(value)), default=0.0)

    chosen = set(sorted(keys, key=strength, reverse=True)[:KEYS])
    left = [key for key in keys if key not in chosen]
    return [key for key in keys if key in chosen], f" Left out, as they go least with it: {', '.join(left)}."


def _bins(x: np.ndarray) -> Iterator[np.ndarray]:
    """Yield a mask of the runs, shape (n,), for each value of a parameter or each part of its range of equal counts."""
    values = np.unique(x)
    if len(values) <= BINS:
        yield from (x == value for value in values)
        return
    edges = np.quantile(x, np.linspace(0.0, 1.0, BINS + 1))
    place = np.searchsorted(edges[1:-1], x, side="right")
    yield from (place == k for k in np.unique(place))


def _with_unit(results: Results, key: str) -> str:
    """Return a parameter's key with its unit, if that is known."""
    unit = results.units.get(key, "")
    return f"{key} [{unit}]" if unit else key


def _texts(results: Results, name: str) -> tuple[str, ...]:
    """Return the values of a parameter of texts, in the order of their numbers."""
    return tuple(np.unique(results[name])) if results[name].dtype == object else ()


def _break_key(key: str) -> str:
    """Break a dotted key into several lines."""
    lines = [""]
    for part in re.findall(r"\[[^\]]*\]|[^.\[]+\.?", key):
        if len(lines[-1] + part) > LETTERS and lines[-1]:
            lines.append("")
        lines[-1] += part
    return "\n".join(lines)


def _dots(points: np.ndarray, name: str, colour: str) -> Line:
    return Line(points[:, 0], points[:, 1], name, colour, marker="circle", size=3.0, joined=False)


def _upright(x: float, name: str, colour: str) -> Line:
    return Line(np.array([x, x]), np.array([0.0, 1.0]), name, colour, 1.1, "dash")


def _grid(panels: list[Panel], caption: str) -> Plot:
    rows = -(-len(panels) // ACROSS)
    return Plot(tuple(panels), caption, 0.9 + 2.3 * rows, (1.0,) * rows, (1.0,) * min(len(panels), ACROSS))
