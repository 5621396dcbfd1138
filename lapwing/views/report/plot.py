"""Plots of the report: data, labels with units and layout, drawn by plotly or matplotlib."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from lapwing.views.report.style import BOUND, FLOWN, POINTS, REFERENCE


class Line(NamedTuple):
    """A curve or points; x, y and, in a panel in space, z have shape (n,). NaN interrupts a curve."""

    x: np.ndarray
    y: np.ndarray
    name: str = ""  # name in the legend; "": no entry
    colour: str = FLOWN
    width: float = 1.3  # [point]
    dash: str = "solid"  # or "dash", "dot", "dashdot"
    marker: str = ""  # or "circle", "open", "square", "cross", "diamond", "triangle"
    size: float = 5.0  # [point] size of the marker
    joined: bool = True  # False: only markers
    fill: str = ""  # colour inside of a closed line
    hidden: bool = False  # in a browser: hidden until a click on its name in the legend
    z: np.ndarray | None = None


class Band(NamedTuple):
    """Area between two curves, shape (n,) each."""

    x: np.ndarray
    low: np.ndarray
    high: np.ndarray
    name: str = ""
    colour: str = BOUND


class Level(NamedTuple):
    """A horizontal line across the panel: a limit, a mean."""

    y: float
    name: str = ""
    colour: str = BOUND
    dash: str = "dash"
    width: float = 1.1  # [point]


class Stretch(NamedTuple):
    """A bar in a lane of a timeline [s]."""

    lane: str
    start: float
    end: float
    text: str
    colour: str = FLOWN


Mark = Line | Band | Level | Stretch


class Panel(NamedTuple):
    """One pair of axes, or three in space, at a place of the plot's grid."""

    marks: tuple[Mark, ...]
    y_label: str = ""
    x_label: str = ""  # set by the plot for a panel over time
    z_label: str = ""  # not empty for a panel in space
    title: str = ""
    note: str = ""  # text in the upper left corner
    row: int = 0
    column: int = 0
    rows: int = 1  # number of rows of the grid that it covers
    columns: int = 1  # number of columns of the grid that it covers
    timed: bool = True  # x is the simulation time [s]
    log_x: bool = False
    log_y: bool = False
    equal: bool = False  # one scale for x and y
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None  # the caption mentions values outside
    x_ticks: tuple[str, ...] = ()  # texts at x = 0, 1, 2, ... instead of numbers


class Plot(NamedTuple):
    """Panels on a grid, with one caption."""

    panels: tuple[Panel, ...]
    caption: str
    height: float  # [inch] height of the plot
    heights: tuple[float, ...] = (1.0,)  # relative heights of the rows
    widths: tuple[float, ...] = (1.0,)  # relative widths of the columns
    span: tuple[float, float] | None = None  # [s] range of panels over time
    phases: tuple[tuple[str, float, float], ...] = ()  # name, start, end [s]; every other one is shaded over time
    unit: str = "s"  # unit of time


class NotRecordedError(Exception):
    """A plot cannot be drawn from this log; the text is the reason."""


def column(panels: Iterable[Panel], height: float = 1.7, **options: object) -> dict:
    """Return panels over time, one below the other with `height` [inch] each, as arguments of a `Plot`."""
    placed = tuple(panel._replace(row=row) for row, panel in enumerate(panels))
    return {"panels": placed, "height": 0.9 + height * len(placed), "heights": (1.0,) * len(placed), **options}


def reference(x: np.ndarray, y: np.ndarray, hidden: bool = False, name: str = "reference") -> Line:
    """Return the dashed line of a reference; x and y have shape (n,)."""
    return Line(x, y, name, REFERENCE, 1.1, "dash", hidden=hidden)


def in_hours(plot: Plot) -> Plot:
    """Return the plot with its time in hours instead of seconds."""

    def scale_mark(mark: Mark) -> Mark:
        if isinstance(mark, Stretch):
            return mark._replace(start=mark.start / 3600.0, end=mark.end / 3600.0)
        return mark if isinstance(mark, Level) else mark._replace(x=mark.x / 3600.0)

    panels = tuple(p._replace(marks=tuple(map(scale_mark, p.marks))) if p.timed else p for p in plot.panels)
    span = plot.span and (plot.span[0] / 3600.0, plot.span[1] / 3600.0)
    phases = tuple((name, start / 3600.0, end / 3600.0) for name, start, end in plot.phases)
    return plot._replace(panels=panels, span=span, phases=phases, unit="h")


def lowest(plot: Plot) -> set[int]:
    """Return the indices of the lowest panels, which have labels of x."""
    ends = [(p.row + p.rows, p.column, p.column + p.columns) for p in plot.panels]
    return {
        i
        for i, (end, left, right) in enumerate(ends)
        if not any(p.row >= end and p.column < right and p.column + p.columns > left for p in plot.panels)
    }


def cube(panel: Panel) -> tuple[np.ndarray, np.ndarray]:
    """Return the lower and upper corner, shape (3,) each, of the cube that bounds a panel in space drawn to scale."""
    lines = [m for m in panel.marks if isinstance(m, Line) and m.z is not None]
    points = np.column_stack([np.concatenate([getattr(line, axis) for line in lines]) for axis in ("x", "y", "z")])
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    half, middle = 0.55 * max((high - low).max(), 0.5), 0.5 * (low + high)
    corner = np.append(middle[:2] - half, min(low[2], 0.0))
    return corner, corner + 2.0 * half


def thin(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return about POINTS samples of a line without gaps, shapes (n,), including its ends and extremes."""
    if len(y) <= POINTS:
        return x, y
    rows = extremes(y)
    return x[rows], y[rows]


def extremes(y: np.ndarray) -> np.ndarray:
    """Return the sorted indices of both ends, and of minimum and maximum of each of POINTS / 2 intervals."""
    length = -(-2 * len(y) // POINTS)
    intervals = np.pad(y, (0, -len(y) % length), mode="edge").reshape(-1, length)
    starts = length * np.arange(len(intervals))
    rows = np.concatenate([[0], starts + intervals.argmin(axis=1), starts + intervals.argmax(axis=1), [len(y) - 1]])
    return np.unique(rows.clip(max=len(y) - 1))


def subsample(values: np.ndarray) -> np.ndarray:
    """Return every k-th sample and the last, shape (m, ...), for data without a time axis: a path, a point cloud."""
    step = max(1, -(-len(values) // POINTS))
    rows = values[::step]
    return rows if (len(values) - 1) % step == 0 else np.concatenate([rows, values[-1:]])


def downsample(mark: Line, of_x: bool) -> Line:
    """Return the downsampled line, a function of x if `of_x`, otherwise a path; a line with gaps stays unchanged."""
    if len(mark.x) <= POINTS or np.isnan(mark.y).any():
        return mark
    if of_x:
        x, y = thin(mark.x, mark.y)
        return mark._replace(x=x, y=y)
    return mark._replace(x=subsample(mark.x), y=subsample(mark.y), z=None if mark.z is None else subsample(mark.z))
