"""The work-precision plot: error over wall time, a line for each method."""

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.accuracy.measure import Point
from studies.report.style import DPI, styled

# Okabe and Ito's palette, then the same again with other markers and dashes
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#333333")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
SMALLEST = 1e-14  # errors below are drawn there


def draw(path: Path, title: str, points: list[Point]) -> None:
    """Write the picture in the format of the file's ending."""
    with styled():
        figure = Figure(figsize=(8.6, 5.6), layout="constrained")
        axes = figure.subplots()
        on_axes(axes, points)
        axes.set_title(title)
        figure.savefig(path, dpi=DPI)


def on_axes(axes: Axes, points: list[Point]) -> None:
    """Draw the lines, and a legend beside them."""
    for index, name in enumerate(dict.fromkeys(p.way for p in points)):
        own = sorted((p for p in points if p.way == name and p.error < 10.0), key=lambda p: p.time)
        again = index >= len(COLOURS)
        axes.plot(
            [1e3 * p.time for p in own],
            [max(p.error, SMALLEST) for p in own],
            color=COLOURS[index % len(COLOURS)],
            marker=MARKERS[index % len(MARKERS)],
            markersize=4.5,
            markerfacecolor="white" if again else None,
            linestyle=(0, (4, 2)) if again else "-",
            label=f"{name} (order {own[0].order})" if own else name,
        )
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("wall time [ms]")
    axes.set_ylabel("largest error at the end, relative to 1 + size [-]")
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), fontsize=8.5)
