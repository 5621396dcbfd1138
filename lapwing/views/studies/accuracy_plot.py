"""Plot of `lapwing accuracy`: error over CPU time of each method, and the error sources of a flight."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lapwing.studies.accuracy.error_budget import ErrorSource
from lapwing.studies.accuracy.work_precision import Point, cheapest
from lapwing.views.report.matplotlib_figure import plot_style
from lapwing.views.report.style import BOUND, DPI, QUIET, TEXT

# Okabe and Ito's palette
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
MARKERS = ("o", "s", "^", "D", "v", "P")
SMALLEST, LARGEST = 1e-14, 10.0  # limits of the plotted errors
LABEL = 0.055  # height of a label in fractions of the axes


def draw(
    path: Path,
    title: str,
    points: list[Point],
    parts: Sequence[ErrorSource] = (),
    goal: float | None = None,
    selected: Point | None = None,
) -> None:
    """Write the plot in the format of the suffix, for a scene with its error sources in a second panel."""
    with plot_style():
        figure = Figure(figsize=(13.0 if parts else 8.0, 5.2), layout="constrained")
        axes = figure.subplots(1, 2 if parts else 1, squeeze=False, width_ratios=(1.6, 1.0) if parts else None)[0]
        draw_points(axes[0], points, goal, selected, "solver.accuracy" if parts else "fewest evaluations")
        axes[0].set_title(title)
        if parts:
            draw_error_sources(axes[1], parts)
        figure.savefig(path, dpi=DPI)


def draw_points(axes: Axes, points: list[Point], goal: float | None, selected: Point | None, why: str = "") -> None:
    """Plot each method from coarse to fine, with the quartiles of the times, the target, and the selected point.

    Args:
        axes: of the plot.
        points: all points.
        goal: the target.
        selected: point to mark.
        why: reason of its selection, beside its name.
    """
    curves = {name: _curve(points, name) for name in dict.fromkeys(p.method for p in points)}
    labelled = _cheapest_methods(points, goal, selected)
    for name, curve in curves.items():
        number = labelled.index(name) if name in labelled else None
        colour = QUIET if number is None else COLOURS[number]
        time, error, low, high = curve
        axes.errorbar(
            time, error, xerr=np.nan_to_num([time - low, high - time]), color=colour, elinewidth=0.9,
            linewidth=0.8 if number is None else 1.5, marker="." if number is None else MARKERS[number],
            markersize=3.0 if number is None else 4.5, zorder=2 if number is None else 3,
        )  # fmt: skip
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("CPU time [ms], bars: quartiles of the repetitions")
    axes.set_ylabel("largest final error, relative to 1 + size [-]")
    if goal is not None:
        axes.axhline(goal, color=BOUND, linewidth=1.2, linestyle=(0, (4, 2)))
        axes.annotate(
            f"target {goal:g}", (1.0, goal), xycoords=("axes fraction", "data"), xytext=(-4, 3),
            textcoords="offset points", ha="right", color=BOUND,
        )  # fmt: skip
    if selected is not None:
        spot = 1e3 * selected.time, max(selected.error, SMALLEST)
        axes.plot(*spot, "o", markersize=13, markerfacecolor="none", markeredgecolor=TEXT, zorder=4)
    if len(labelled) < len(curves):
        axes.text(0.01, 0.02, "grey: other methods", transform=axes.transAxes, fontsize=9.5, color="#555555")
    names = {name: f"{name}, {why}" if selected and name == selected.method else name for name in labelled}
    _label(axes, {names[name]: curves[name] for name in labelled})


def _curve(points: list[Point], name: str) -> np.ndarray:
    """Return (time, error, lower and upper quartile of the time [ms]) of a method from coarse to fine, shape (4, n)."""
    rows = [(p.time, p.error, *p.spread) for p in points if p.method == name and p.error < LARGEST]
    time, error, low, high = np.array(rows).reshape(-1, 4).T
    return np.array([1e3 * time, np.maximum(error, SMALLEST), 1e3 * low, 1e3 * high])


def _cheapest_methods(points: list[Point], goal: float | None, selected: Point | None) -> list[str]:
    """Return at most six methods: the selected one, the cheapest at each error down from the goal, those near it."""
    level = goal or 1.0

    def order(name: str) -> tuple[bool, float]:
        own = [p for p in points if p.method == name]
        met = [p.work[0] for p in own if p.error <= level]
        return not met, min(met, default=min(p.error for p in own))

    chosen = [selected.method] if selected else []
    front = [cheapest(points, p.error).method for p in sorted(points, key=lambda p: p.error) if p.error <= level]
    near = sorted((p.method for p in points), key=order)
    return list(dict.fromkeys([*chosen, *front, *near]))[: len(COLOURS)]


def _label(axes: Axes, curves: dict[str, np.ndarray]) -> None:
    """Write the names of the curves at the right edge, each with a line to the end of its curve."""
    low, high = np.log10(axes.get_ylim())
    ends = {name: (float(curve[0, -1]), float(curve[1, -1])) for name, curve in curves.items() if curve.size}
    height = {name: (np.log10(end[1]) - low) / (high - low) for name, end in ends.items()}
    upper = 1.0 + LABEL
    for below, (number, name) in enumerate(sorted(enumerate(ends), key=lambda item: -height[item[1]]), 1 - len(ends)):
        upper = max(min(height[name], upper - LABEL), -LABEL * below)
        axes.annotate(
            name, ends[name], xytext=(1.03, upper), textcoords="axes fraction", va="center", fontsize=9.5,
            color=COLOURS[number], arrowprops={"arrowstyle": "-", "color": COLOURS[number], "linewidth": 0.7},
        )  # fmt: skip


def draw_error_sources(axes: Axes, parts: Sequence[ErrorSource]) -> None:
    """Plot the errors by step, communication step and coupling: position, or attitude without translation."""
    parts = [p for p in parts if p.source != "contact"]  # its setting is not a time
    moves = any(p.position > 0.0 for p in parts)
    for index, source in enumerate(dict.fromkeys(p.source for p in parts)):
        own = [p for p in parts if p.source == source]
        axes.plot(
            [1e3 * p.setting for p in own],
            [max(p.position if moves else p.attitude, SMALLEST) for p in own],
            color=COLOURS[index],
            marker=MARKERS[index],
            label=source,
        )
    axes.set_xscale("log")
    axes.set_yscale("log")
    sizes = sorted({1e3 * p.setting for p in parts})
    axes.set_xticks(sizes, [f"{size:g}" for size in sizes])
    axes.set_xticks([], minor=True)
    axes.set_title("error sources of the flight")
    axes.set_xlabel("step, or communication step [ms]")
    axes.set_ylabel(f"difference of {'position' if moves else 'attitude'}, 90th percentile [{'m' if moves else 'rad'}]")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=3)
