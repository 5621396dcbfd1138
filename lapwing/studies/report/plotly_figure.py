"""Plots in a browser: figures of plotly.js as JSON."""

import json
from typing import Any

import numpy as np

from lapwing.studies.report.plot import Panel, Plot, Stretch, lowest
from lapwing.studies.report.plotly_traces import in_legend, text_of, traces
from lapwing.studies.report.style import SHADE, TEXT

PIXELS = 100  # per inch on the page
_GAP_X, _GAP_Y = 78.0, 26.0  # [pixel] between panels, for the labels of the right one and the title of the lower one
_GAP_X_LABEL = 30.0  # [pixel] additional gap below a panel with a label of x
_PAGE = 900.0  # [pixel] typical total width of the panels
_NARROW = 300.0  # [pixel] width of the panels on a phone
_LETTER, _SYMBOL = 6.6, 48.0  # [pixel] width of a character and of a symbol in a legend
_FIRST_LINE, _LINE = 22, 28  # [pixel] height of the first line and of each further line of a legend
_WIDE = "wide"  # name of an annotation that is too wide for a phone
_MARGIN = {"l": 68, "r": 12, "b": 44}  # [pixel]; see _top for the upper one
_FONT = {"family": "system-ui, sans-serif", "size": 12, "color": TEXT}
_GRID = {"gridcolor": "#E3E7EA", "linecolor": "#888888", "zerolinecolor": "#C5CBD0", "ticks": "outside", "ticklen": 4}
_NUMBERS = {"exponentformat": "power", "minexponent": 4}  # 0.0002 instead of plotly's 200 with a prefix


def to_json(plot: Plot) -> str:
    """Return the `figure` of a plot as JSON text, escaped for an HTML element."""
    return json.dumps(figure(plot), separators=(",", ":")).replace("<", "\\u003c")


def figure(plot: Plot) -> dict[str, Any]:
    """Return "data" and "layout" of a plot, its time axes "timed", which the page links, and the "narrow" layout."""
    data: list[dict] = []
    layout: dict[str, Any] = {
        "height": round(plot.height * PIXELS),
        "margin": {**_MARGIN, "t": _top(plot)},
        "font": _FONT,
        "hovermode": "x unified" if all(p.timed for p in plot.panels) else "closest",
        "legend": {"orientation": "h", "x": 0, "y": 1, "yref": "container", "yanchor": "top"},
        "modebar": {"bgcolor": "#FFFFFF", "color": "#888888", "activecolor": TEXT},
        "shapes": [],
        "annotations": [],
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "hoverlabel": {"bgcolor": "#FFFFFF", "bordercolor": "#888888", "font": {"color": TEXT}, "namelength": -1},
        "barmode": "overlay",
        "uniformtext": {"mode": "hide", "minsize": 10},
    }
    timed: list[str] = []
    named: set[tuple] = set()
    ends = lowest(plot)
    for index, panel in enumerate(plot.panels):
        number = "" if index == 0 else str(index + 1)
        domain_x, domain_y = _domains(plot, panel)
        where = {"xaxis": f"x{number}", "yaxis": f"y{number}"}
        _axes(layout, plot, panel, number, (domain_x, domain_y), timed, index in ends)
        for mark in panel.marks:
            for trace in traces(mark, plot, panel):
                trace.update(where)
                in_legend(trace, named)
                data.append(trace)
    return {"data": data, "layout": layout, "timed": timed, "narrow": _narrow(plot)}


def _narrow(plot: Plot) -> dict[str, Any]:
    """Return height and top margin [pixel] and vertical domains by axis number for a page with one column."""
    inner = plot.height * PIXELS - _top(plot) - _MARGIN["b"]
    order = sorted(range(len(plot.panels)), key=lambda i: (plot.panels[i].row, plot.panels[i].column))
    heights = {}
    for i in order:
        panel = plot.panels[i]
        share = sum(plot.heights[panel.row : panel.row + panel.rows]) / sum(plot.heights)
        most = 320.0 if panel.equal or len(plot.panels) == 1 else 190.0
        heights[i] = min(max(share * inner - _GAP_Y, 110.0), max(most, share * inner if len(plot.widths) == 1 else 0.0))
    gaps = {i: _GAP_Y + _GAP_X_LABEL * (not plot.panels[i].timed or i in lowest(plot)) for i in order}
    total = sum(heights.values()) + sum(gaps[i] for i in order[:-1])
    domains, down = {}, 0.0
    for i in order:
        ends = 1.0 - (down + heights[i]) / total, 1.0 - down / total
        domains["" if i == 0 else str(i + 1)] = [round(min(max(end, 0.0), 1.0), 5) for end in ends]
        down += heights[i] + gaps[i]
    top = _top(plot, _NARROW)
    return {"height": round(total + top + _MARGIN["b"]), "top": top, "domains": domains}


def _axes(layout: dict, plot: Plot, panel: Panel, number: str, domains: tuple, timed: list[str], bottom: bool) -> None:
    x: dict[str, Any] = {"domain": domains[0], "anchor": f"y{number}", "hoverformat": ".5~g", **_NUMBERS, **_GRID}
    y: dict[str, Any] = {"domain": domains[1], "anchor": f"x{number}", "hoverformat": ".5~g", **_NUMBERS, **_GRID}
    y["title"] = {"text": text_of(panel.y_label), "standoff": 6}
    if panel.y_label and domains[0][0] == 0.0:
        y["automargin"] = True  # numbers with many digits would overlap the label
    x["title"] = {"text": text_of(panel.x_label), "standoff": 4}
    if panel.log_x:
        x |= {"type": "log", "dtick": 1}
    if panel.log_y:
        y |= {"type": "log", "exponentformat": "power"}
    if panel.y_range:
        y["range"] = list(np.log10(panel.y_range) if panel.log_y else panel.y_range)
    if panel.x_range:
        x["range"] = list(np.log10(panel.x_range) if panel.log_x else panel.x_range)
    if panel.x_ticks:
        x |= {"tickvals": list(range(len(panel.x_ticks))), "ticktext": [text_of(text) for text in panel.x_ticks]}
        x["automargin"] = True  # a text may have several lines
        x["range"] = [-0.5, len(panel.x_ticks) - 0.5]
    if panel.equal:
        y |= {"scaleanchor": f"x{number}", "scaleratio": 1}
        x["constrain"] = y["constrain"] = "range"
    if any(isinstance(mark, Stretch) for mark in panel.marks):
        y |= {
            "autorange": "reversed",
            "type": "category",
            "ticks": "",
            "showgrid": False,
            "fixedrange": True,
            "automargin": True,
        }
    if panel.timed:
        if timed:
            x["matches"] = timed[0].replace("axis", "")
        x |= {"showgrid": False, "zeroline": False, "showticklabels": bottom, "ticks": "outside" if bottom else ""}
        x["title"]["text"] = f"time [{plot.unit}]" if bottom else ""
        x["unifiedhovertitle"] = {"text": f"%{{x:.6~g}} {plot.unit}"}
        if plot.span:
            x["range"] = list(plot.span)
        timed.append(f"xaxis{number}")
        _phases(layout, plot, panel, number)
    corner: dict[str, Any] = {
        "showarrow": False,
        "xref": f"x{number} domain",
        "yref": f"y{number} domain",
        "xanchor": "left",
    }
    small = {"size": 11, "color": "#555555"}
    if panel.title:
        layout["annotations"].append(
            {**corner, "text": text_of(panel.title), "x": 0, "y": 1, "yanchor": "bottom", "font": small}
        )
    if panel.note:
        layout["annotations"].append(
            {**corner, "text": text_of(panel.note), "x": 0.01, "y": 0.99, "yanchor": "top", "font": small}
        )
    layout[f"xaxis{number}"], layout[f"yaxis{number}"] = x, y


def _phases(layout: dict, plot: Plot, panel: Panel, number: str) -> None:
    """Shade every other phase, and name the phases above the panels of the first row if there is room."""
    span = plot.span or (0.0, 1.0)
    room = 130 * panel.columns / len(plot.widths) / (span[1] - span[0])  # [1/s] characters per time
    narrow_room = 45 / (span[1] - span[0])
    for index, (name, start, end) in enumerate(plot.phases):
        if index % 2:
            place = {"type": "rect", "xref": f"x{number}", "yref": f"y{number} domain", "layer": "below"}
            shape = {**place, "x0": start, "x1": end, "y0": 0, "y1": 1, "line": {"width": 0}, "fillcolor": SHADE}
            layout["shapes"].append(shape)
        if panel.row == 0 and not panel.title and len(name) <= room * (end - start):
            middle: dict[str, Any] = {"xref": f"x{number}", "yref": f"y{number} domain", "x": (start + end) / 2, "y": 1}
            style: dict[str, Any] = {"showarrow": False, "yanchor": "bottom", "font": {"size": 10, "color": "#555555"}}
            too_long = len(name) > narrow_room * (end - start)
            layout["annotations"].append({**middle, **style, "text": text_of(name), "name": _WIDE if too_long else ""})


def _domains(plot: Plot, panel: Panel) -> tuple[list[float], list[float]]:
    """Return the horizontal and vertical domain of a panel, as shares of the figure."""
    inner = plot.height * PIXELS - _top(plot) - _MARGIN["b"]
    has_x_labels = any(not p.timed for p in plot.panels)
    gap_y = _GAP_Y + (_GAP_X_LABEL if has_x_labels and len(plot.heights) > 1 else 0.0)
    x = _share(plot.widths, _GAP_X / _PAGE, panel.column, panel.columns)
    top = _share(plot.heights, gap_y / inner, panel.row, panel.rows)
    return x, [1.0 - top[1], 1.0 - top[0]]


def _top(plot: Plot, width: float = _PAGE) -> int:
    """Return the space [pixel] above the panels for legend, titles and names of phases."""
    names = dict.fromkeys(getattr(mark, "name", "") for panel in plot.panels for mark in panel.marks)
    lines, used = 0, width
    for name in filter(None, names):
        needed = _LETTER * len(name) + _SYMBOL
        lines, used = (lines + 1, needed) if used + needed > width else (lines, used + needed)
    titles = 18 if plot.phases or any(panel.title for panel in plot.panels) else 0
    return 6 + (_FIRST_LINE + _LINE * (lines - 1) if lines else 0) + titles


def _share(parts: tuple[float, ...], gap: float, first: int, count: int) -> list[float]:
    free = max(1.0 - gap * (len(parts) - 1), 0.1)
    sizes = [free * part / sum(parts) for part in parts]
    start = sum(sizes[:first]) + gap * first
    end = start + sum(sizes[first : first + count]) + gap * (count - 1)
    return [round(min(max(v, 0.0), 1.0), 5) for v in (start, end)]
