"""How every plot of the report looks."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Literal

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.flight import Flight

STEERED = ("reduced", "multibody")  # the models of vehicles that an autopilot flies

WIDTH = 10.0  # [inch] of every figure; the page shows 100 pixels an inch
DPI = 125
LEFT, RIGHT, TOP, BOTTOM = 0.9, 0.1, 0.28, 0.5  # [inch] beside the plots; fixed, since finding them doubles the time
POINTS = 4000  # drawn of a line at most

# Okabe and Ito's palette: told apart also without red-green vision.
FLOWN = "#0072B2"
REFERENCE = "#333333"
BOUND = "#D55E00"
AXIS_COLOURS = ("#0072B2", "#E69F00", "#009E73")
SHADE = "#F1F3F5"
DASHED: dict[str, Any] = {"color": REFERENCE, "linestyle": (0, (4, 3)), "linewidth": 1.1}

_PARAMETERS: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#666666",
    "axes.labelcolor": "#222222",
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#D9DDE1",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "lines.linewidth": 1.3,
    "xtick.color": "#444444",
    "ytick.color": "#444444",
    "figure.facecolor": "white",
}


class NotRecordedError(Exception):
    """A plot cannot be drawn from this log; the text says what is missing."""


@contextmanager
def styled() -> Iterator[None]:
    """Draw within this, so that nothing else in the process changes its looks."""
    with matplotlib.rc_context(_PARAMETERS):
        yield


def rows(
    count: int, columns: int = 1, height: float = 1.9, sharey: Literal["none", "row"] = "none"
) -> tuple[Figure, np.ndarray]:
    """A figure with rows of plots over one time axis, a row `height` [inch] high; axes have shape (count, columns)."""
    tall = TOP + BOTTOM + height * count
    figure = Figure(figsize=(WIDTH, tall))
    axes = figure.subplots(count, columns, sharex=True, sharey=sharey, squeeze=False)
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    between = 0.12 if sharey == "row" else LEFT
    wide = (WIDTH - LEFT - RIGHT - between * (columns - 1)) / columns
    figure.subplots_adjust(LEFT / WIDTH, BOTTOM / tall, 1 - RIGHT / WIDTH, 1 - TOP / tall, between / wide, 0.16)
    for axis in axes.flat:
        axis.yaxis.set_label_coords(-(LEFT - 0.26) / wide, 0.5)
    return figure, axes


def line(axes: Axes, t: np.ndarray, y: np.ndarray, **looks: Any) -> None:
    """Plot y over t; of a long line only the extremes of short stretches are drawn, so no peak is lost."""
    if len(y) > POINTS:
        length = -(-2 * len(y) // POINTS)
        stretches = np.pad(y, (0, -len(y) % length), mode="edge").reshape(-1, length)
        starts = length * np.arange(len(stretches))
        kept = np.concatenate([[0], starts + stretches.argmin(axis=1), starts + stretches.argmax(axis=1), [len(y) - 1]])
        kept = np.unique(kept.clip(max=len(y) - 1))
        t, y = t[kept], y[kept]
    axes.plot(t, y, **looks)


def phases(flight: Flight) -> list[tuple[str, float, float]]:
    """Name, start and end [s] of each phase of the mission, in order; empty without setpoints."""
    if not flight.has("setpoint"):
        return []
    names, t = flight.setpoint.phase, flight.setpoint.times
    starts = [0, *(np.flatnonzero(names[1:] != names[:-1]) + 1)]
    ends = [*t[starts[1:]], t[-1]]
    return [(str(names[k]), float(t[k]), float(end)) for k, end in zip(starts, ends, strict=True) if names[k]]


def shade_phases(axes: np.ndarray, flight: Flight) -> None:
    """Shade every other phase of the mission in all plots, and name the phases over those of the first row."""
    found = phases(flight)
    span = max(flight.truth.times[-1] - flight.truth.times[0], 1e-9)
    room = 115 / axes.shape[1] / span  # letters a second of time
    for index, (name, start, end) in enumerate(found):
        if index % 2:
            for axis in axes.flat:
                axis.axvspan(start, end, color=SHADE, linewidth=0, zorder=0)
        if axes.shape[1] == 1 and len(name) <= room * (end - start):
            across = axes[0, 0].get_xaxis_transform()
            axes[0, 0].text(
                (start + end) / 2, 1.02, name, transform=across, ha="center", va="bottom", fontsize=8, color="#555555"
            )
    for axis in axes.flat:
        axis.set_xlim(flight.truth.times[0], flight.truth.times[0] + span)
        axis.grid(visible=False, axis="x")
