"""Work-precision plot: error over wall time, a line for each method."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lapwing.studies.accuracy.error_budget import ErrorSource
from lapwing.studies.accuracy.work_precision import Point
from lapwing.studies.report.matplotlib_figure import plot_style
from lapwing.studies.report.style import DPI

# Okabe and Ito's palette, repeated with white markers and dashes
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#333333")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
SMALLEST = 1e-14  # lower limit of the plotted errors


def draw(path: Path, title: str, points: list[Point], parts: Sequence[ErrorSource] = ()) -> None:
    """Write the plot in the format of the suffix, for a scene with its error sources in a second panel."""
    with plot_style():
        figure = Figure(figsize=(14.0 if parts else 8.6, 5.6), layout="constrained")
        axes = figure.subplots(1, 2 if parts else 1, squeeze=False, width_ratios=(1.6, 1.0) if parts else None)[0]
        draw_points(axes[0], points)
        axes[0].set_title(title)
        if parts:
            draw_error_sources(axes[1], parts)
        figure.savefig(path, dpi=DPI)


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
    axes.legend()


def draw_points(axes: Axes, points: list[Point]) -> None:
    """Plot a line for each method, with a legend on the right."""
    for index, name in enumerate(dict.fromkeys(p.method for p in points)):
        own = sorted((p for p in points if p.method == name and p.error < 10.0), key=lambda p: p.time)
        repeated = index >= len(COLOURS)
        axes.plot(
            [1e3 * p.time for p in own],
            [max(p.error, SMALLEST) for p in own],
            color=COLOURS[index % len(COLOURS)],
            marker=MARKERS[index % len(MARKERS)],
            markersize=4.5,
            markerfacecolor="white" if repeated else None,
            linestyle=(0, (4, 2)) if repeated else "-",
            label=f"{name} (order {own[0].order})" if own else name,
        )
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("wall time [ms]")
    axes.set_ylabel("largest final error, relative to 1 + size [-]")
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), fontsize=8.5)
