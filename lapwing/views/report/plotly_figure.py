"""Plots in a browser: figures of plotly.js as JSON."""

import base64
import html
import json
from typing import Any

import numpy as np

from lapwing.views.report.plot import Band, Level, Line, Mark, Panel, Plot, Stretch, downsample, extremes, lowest
from lapwing.views.report.style import SHADE, TEXT

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
    """Return height and top margin [pixel], vertical domains by axis number and labels for a page with one column."""
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
    return {"height": round(total + top + _MARGIN["b"]), "top": top, "domains": domains, "titles": _shared_labels(plot)}


def _shared_labels(plot: Plot) -> dict[str, str]:
    """Return by axis the labels that panels share with their row or column, which a single column separates."""
    result = {}
    for i, panel in enumerate(plot.panels):
        number = "" if i == 0 else str(i + 1)
        left = [other for other in plot.panels if other.row == panel.row and other.column < panel.column]
        row = [other.y_label for other in left if other.y_label]
        column = [o.x_label for o in plot.panels if o.column == panel.column and not o.timed and o.x_label]
        if not panel.y_label and row:
            result[f"yaxis{number}"] = text_of(row[0])
        if not (panel.x_label or panel.timed) and column:
            result[f"xaxis{number}"] = text_of(column[-1])
    return result


def _axes(layout: dict, plot: Plot, panel: Panel, number: str, domains: tuple, timed: list[str], bottom: bool) -> None:
    x: dict[str, Any] = {"domain": domains[0], "anchor": f"y{number}", "hoverformat": ".5~g", **_NUMBERS, **_GRID}
    y: dict[str, Any] = {"domain": domains[1], "anchor": f"x{number}", "hoverformat": ".5~g", **_NUMBERS, **_GRID}
    y["title"] = {"text": text_of(panel.y_label), "standoff": 6}
    if panel.y_label and domains[0][0] == 0.0:
        y["automargin"] = True  # numbers with many digits would overlap the label
    x["title"] = {"text": text_of(panel.x_label), "standoff": 4}
    if panel.log_x:
        values = [value for mark in panel.marks if isinstance(mark, Line) for value in mark.x if value > 0.0]
        wide = not values or max(values) > 30.0 * min(values)
        x |= {"type": "log", "dtick": 1 if wide else "D2"}  # D2: numbers also at 2 and 5
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


_POINT = 96.0 / 72.0  # [pixel] in a typographic point
FEW = 8  # largest number of values that are written as text
STEPS = 32767  # quantisation steps from the centre of a range to its ends
_SYMBOLS = {"circle": "circle", "open": "circle-open", "square": "square", "cross": "x", "diamond": "diamond"}
_SYMBOLS |= {"triangle": "triangle-up"}


def traces(mark: Mark, plot: Plot, panel: Panel) -> list[dict[str, Any]]:
    """Return the traces of a mark without their axes: two of a band, one of any other mark."""
    if isinstance(mark, Level):
        return [_level(mark, plot, panel)]
    if isinstance(mark, Stretch):
        return [_bar(mark)]
    if isinstance(mark, Band):
        rows = extremes(mark.high)
        exact = (panel.log_x, panel.log_y)
        style = {"type": "scatter", "mode": "lines", "line": {"width": 0, "color": mark.colour}, "hoverinfo": "skip"}
        x = _array(mark.x[rows], exact[0])
        low = {**style, "x": x, "y": _array(mark.low[rows], exact[1]), "name": text_of(mark.name), "showlegend": False}
        filled = {"fill": "tonexty", "fillcolor": _pale(mark.colour), "name": text_of(mark.name)}
        return [low, {**style, "x": x, "y": _array(mark.high[rows], exact[1]), **filled}]
    return [_line(mark, panel)]


def in_legend(trace: dict, named: set[tuple]) -> None:
    """Group traces of one name and style under one legend entry, which toggles them together."""
    if not trace.get("name"):
        trace.update(showlegend=False, name="")
        return
    key = (trace["name"], trace.get("line", {}).get("color"), trace.get("line", {}).get("dash"))
    trace.update(legendgroup="/".join(map(str, key)), showlegend=trace.get("showlegend", True) and key not in named)
    if trace["showlegend"]:
        named.add(key)


def _line(mark: Line, panel: Panel) -> dict:
    line = downsample(mark, panel.timed)
    modes = [mode for mode, is_on in (("lines", line.joined), ("markers", line.marker)) if is_on]
    trace: dict[str, Any] = {
        "type": "scatter",
        "mode": "+".join(modes) or "none",
        "x": _array(line.x, panel.log_x, panel.x_range),
        "y": _array(line.y, panel.log_y, panel.y_range),
        "line": {"color": line.colour, "width": round(line.width * _POINT, 2), "dash": line.dash},
        "name": text_of(line.name),
    }
    if line.marker:
        trace["marker"] = {"symbol": _SYMBOLS[line.marker], "size": line.size * _POINT, "color": line.colour}
    if line.fill:
        trace |= {"fill": "toself", "fillcolor": line.fill}
    if line.hidden:
        trace["visible"] = "legendonly"
    if not line.name:
        label = text_of(panel.y_label.partition(" [")[0])
        trace["hovertemplate"] = f"{label} %{{y}}<extra></extra>"
    elif panel.timed:
        trace["hovertemplate"] = "%{y}"  # the cursor is between samples: Plotly would show (time, value)
    return trace


def _level(mark: Level, plot: Plot, panel: Panel) -> dict:
    """Return a level as a trace instead of a shape, so that it is in the legend and shows its value."""
    lines = [m for m in panel.marks if isinstance(m, Line) and len(m.x)]
    ends = [f(m.x) for m in lines for f in (np.nanmin, np.nanmax)] or [0.0, 1.0]
    low, high = plot.span if plot.span and panel.timed else panel.x_range or (min(ends), max(ends))
    style = {"color": mark.colour, "width": round(mark.width * _POINT, 2), "dash": mark.dash}
    x, y = [float(low), float(high)], [mark.y, mark.y]
    return {
        "type": "scatter",
        "mode": "lines",
        "x": x,
        "y": y,
        "line": style,
        "name": text_of(mark.name),
        "hoverinfo": "skip",
    }


def _bar(mark: Stretch) -> dict:
    interval = f"{mark.start:.2f} to {mark.end:.2f}"
    return {
        "type": "bar",
        "orientation": "h",
        "base": [mark.start],
        "x": [mark.end - mark.start],
        "y": [text_of(mark.lane)],
        "text": [text_of(mark.text)],
        "textposition": "inside",
        "insidetextanchor": "middle",
        "textangle": 0,
        "marker": {"color": _pale(mark.colour, 0.45), "line": {"color": "#FFFFFF", "width": 1}},
        "textfont": {"color": "#222222"},
        "hovertemplate": f"%{{y}}: %{{text}}<br>{interval}<extra></extra>",
    }


def _pale(colour: str, opacity: float = 0.16) -> str:
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red},{green},{blue},{opacity})"


def _array(values: np.ndarray, log: bool = False, shown: tuple[float, float] | None = None) -> Any:
    """Return numbers for page.js: a few as text, many as 16-bit steps of their range; NaN is the lowest step.

    Each step is the difference from the previous one; all low bytes precede all high bytes, which compresses well.

    Args:
        values: numbers, shape (n,).
        log: True for a logarithmic axis: equal steps are too coarse, so the numbers have single precision.
        shown: range of the axis; if it is much narrower than that of the values, they have single precision, too.
    """
    finite = np.isfinite(values)
    if len(values) <= FEW:
        return [float(v) if ok else None for v, ok in zip(values, finite, strict=True)]
    low, high = (float(f(values[finite])) if finite.any() else 0.0 for f in (np.min, np.max))
    step = (high - low) / (2 * STEPS)
    if log or (shown is not None and step > abs(shown[1] - shown[0]) / 4000):
        largest = np.finfo("<f4").max
        data = np.ascontiguousarray(values.clip(-largest, largest), dtype="<f4").tobytes()
        return {"dtype": "f4", "bdata": base64.b64encode(data).decode("ascii")}
    counts = np.zeros(len(values)) if step == 0.0 else np.round((np.where(finite, values, low) - low) / step) - STEPS
    changes = np.diff(np.where(finite, counts, -STEPS - 1).astype("<i2"), prepend=np.int16(0)).astype("<i2")
    planes = changes.view(np.uint8).reshape(-1, 2).T.tobytes()
    return {"low": low, "step": step, "steps": base64.b64encode(planes).decode("ascii")}


def text_of(text: str) -> str:
    """Return a text escaped for plotly.js, which reads < and & as markup."""
    return html.escape(text, quote=False).replace("\n", "<br>")
