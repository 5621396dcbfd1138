"""Plots drawn by matplotlib, as PDF or PNG."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure, SubFigure
from matplotlib.image import imsave
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator

from lapwing.views.report.plot import Band, Level, Line, Mark, Panel, Plot, Stretch, cube, downsample, extremes, lowest
from lapwing.views.report.style import DPI, SHADE, WIDTH

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
LEGEND = 130  # characters in the width of a legend, including six per entry for its symbol
NUMBERS = 14  # tick labels of five digits along the width of a plot
STEPS = (1, 2, 2.5, 5, 10)  # multiples between ticks
_DASHES: dict[str, Any] = {"solid": "-", "dash": (0, (4, 3)), "dot": (0, (1, 1.5)), "dashdot": (0, (6, 2, 1, 2))}
_MARKERS = {"": "", "circle": "o", "open": "o", "square": "s", "cross": "X", "diamond": "D", "triangle": "^"}


@contextmanager
def plot_style() -> Iterator[None]:
    """Apply the style of the plots within the context, without an effect on other figures of the process."""
    with matplotlib.rc_context(_PARAMETERS):
        yield


def write_png(path: Path, plots: Sequence[Plot]) -> None:
    """Write all plots, one below the other, in one image."""
    with plot_style():
        pictures = []
        for plot in plots:
            canvas = FigureCanvasAgg(figure(plot))
            canvas.draw()
            pictures.append(np.asarray(canvas.buffer_rgba()))
        imsave(path, np.concatenate(pictures), format="png", metadata={"Software": ""})


class NotebookFigure(Figure):
    """Figure that a notebook shows without an import of pyplot."""

    def _repr_png_(self) -> bytes:
        with plot_style():
            data = BytesIO()
            self.savefig(data, format="png")
        return data.getvalue()


def figure(plot: Plot) -> Figure:
    """Return the plot as a figure of `WIDTH`; call this and save the figure within `plot_style`."""
    figure = NotebookFigure(figsize=(WIDTH, plot.height), dpi=DPI, layout="constrained")
    draw_plot(plot, figure)
    show_dollars(figure)
    return figure


def show_dollars(figure: Figure) -> None:
    """Draw each "$" of a name literally instead of as a formula; tick labels do not exist yet."""
    for text in figure.findobj(Text):
        if "$" in text.get_text():
            text.set_parse_math(False)


def draw_plot(plot: Plot, figure: Figure | SubFigure) -> None:
    """Draw a plot into a figure or a subfigure; call within `plot_style`."""
    grid = figure.add_gridspec(
        len(plot.heights), len(plot.widths), height_ratios=plot.heights, width_ratios=plot.widths
    )
    named: dict[str, Any] = {}
    first: Axes | None = None
    for index, panel in enumerate(plot.panels):
        place = grid[panel.row : panel.row + panel.rows, panel.column : panel.column + panel.columns]
        if panel.z_label:
            axes = figure.add_subplot(place, projection="3d")
            _space(axes, panel)
        else:
            axes = figure.add_subplot(place, sharex=first if panel.timed else None)
            _flat(axes, plot, panel)
        handles, names = axes.get_legend_handles_labels()
        named = dict(zip(names, handles, strict=True)) | named
        if panel.timed and not panel.z_label:
            first = first or axes
            bottom = index in lowest(plot)
            axes.tick_params(labelbottom=bottom)
            axes.set_xlabel(f"time [{plot.unit}]" if bottom else "")
            _over_time(axes, plot, panel)
    if named:
        figure.legend(named.values(), named.keys(), loc="outside upper left", ncols=_columns(named), fontsize="small")


def _columns(names: Iterable[str]) -> int:
    """Return the number of columns of a legend that fit in the width of a figure."""
    return max(1, min(6, LEGEND // (max(map(len, names)) + 6)))


def _flat(axes: Axes, plot: Plot, panel: Panel) -> None:
    lanes = list(dict.fromkeys(m.lane for m in panel.marks if isinstance(m, Stretch)))
    for mark in panel.marks:
        _draw(axes, mark, plot, panel, lanes)
    axes.set(xlabel=panel.x_label, ylabel=panel.y_label, title=panel.title)
    if panel.log_x:
        axes.set_xscale("log")
    elif not panel.timed:
        axes.xaxis.set_major_locator(MaxNLocator(NUMBERS // len(plot.widths), steps=STEPS))
    if panel.log_y:
        axes.set_yscale("log")
    else:
        axes.ticklabel_format(axis="y", useOffset=False)
    if panel.equal:
        axes.set_aspect("equal", adjustable="box" if panel.x_range else "datalim")
    if panel.x_range:
        axes.set_xlim(panel.x_range)
    if panel.y_range:
        axes.set_ylim(panel.y_range)
    if panel.x_ticks:
        axes.set_xticks(range(len(panel.x_ticks)), panel.x_ticks)
    if lanes:
        axes.set_yticks(range(len(lanes)), lanes)
        axes.set_ylim(len(lanes) - 0.5, -0.5)
    if panel.note:
        style: dict[str, Any] = {"ha": "left", "va": "top", "fontsize": 8, "color": "#555555"}
        axes.text(0.02, 0.97, panel.note, transform=axes.transAxes, **style)


def _draw(axes: Axes, mark: Mark, plot: Plot, panel: Panel, lanes: list[str]) -> None:
    name = getattr(mark, "name", "") or None
    if isinstance(mark, Level):
        axes.axhline(mark.y, color=mark.colour, linewidth=mark.width, linestyle=_DASHES[mark.dash], label=name)
    elif isinstance(mark, Band):
        rows = extremes(mark.high)
        x, low, high = mark.x[rows], mark.low[rows], mark.high[rows]
        axes.fill_between(x, low, high, color=mark.colour, alpha=0.16, linewidth=0, label=name)
    elif isinstance(mark, Stretch):
        lane = lanes.index(mark.lane)
        axes.broken_barh([(mark.start, mark.end - mark.start)], (lane - 0.4, 0.8), color=mark.colour, alpha=0.6)
        if _fits(mark.text, mark.end - mark.start, plot, panel):
            axes.text((mark.start + mark.end) / 2, lane, mark.text, ha="center", va="center", fontsize=8)
    else:
        line = downsample(mark, panel.timed)
        if line.fill:
            axes.fill(line.x, line.y, color=line.fill, linewidth=0)
        axes.plot(line.x, line.y, label=name, **_line_style(line))


def _space(axes: Any, panel: Panel) -> None:
    for line in (downsample(mark, False) for mark in panel.marks if isinstance(mark, Line)):
        axes.plot(line.x, line.y, line.z, label=line.name or None, **_line_style(line))
    low, high = cube(panel)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect((1, 1, 1), zoom=0.88)
    axes.set(xlabel=panel.x_label, ylabel=panel.y_label)
    axes.zaxis.set_rotate_label(False)  # it would be upside down
    axes.set_zlabel(panel.z_label, rotation=90)
    axes.view_init(elev=24, azim=-128)


def _line_style(line: Line) -> dict[str, Any]:
    return {
        "color": line.colour,
        "linewidth": line.width,
        "linestyle": _DASHES[line.dash] if line.joined else "none",
        "marker": _MARKERS[line.marker],
        "markersize": line.size,
        "markerfacecolor": "white" if line.marker == "open" else line.colour,
        "zorder": 2.5 if line.dash == "dash" else 2,
    }


def _over_time(axes: Axes, plot: Plot, panel: Panel) -> None:
    """Shade every other phase, and name the phases above the panels of the first row if there is room."""
    span = plot.span or axes.get_xlim()
    for index, (name, start, end) in enumerate(plot.phases):
        if index % 2:
            axes.axvspan(start, end, color=SHADE, linewidth=0, zorder=0)
        if panel.row == 0 and not panel.title and _fits(name, end - start, plot, panel):
            style: dict[str, Any] = {"ha": "center", "va": "bottom", "fontsize": 8, "color": "#555555"}
            axes.text((start + end) / 2, 1.02, name, transform=axes.get_xaxis_transform(), **style)
    axes.set_xlim(span)
    axes.grid(visible=False, axis="x")


def _fits(text: str, duration: float, plot: Plot, panel: Panel) -> bool:
    """Return True if a text fits over a duration, at about 115 characters per figure width."""
    start, end = plot.span or (0.0, duration)
    return len(text) <= 115 * panel.columns / len(plot.widths) * duration / ((end - start) or 1.0)
