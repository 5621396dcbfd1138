"""Marks of a plot as traces of plotly.js."""

import base64
import html
from typing import Any

import numpy as np

from lapwing.studies.report.downsampling import downsample, extremes
from lapwing.studies.report.plot import Band, Level, Line, Mark, Panel, Plot, Stretch

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
        data = np.ascontiguousarray(values, dtype="<f4").tobytes()
        return {"dtype": "f4", "bdata": base64.b64encode(data).decode("ascii")}
    counts = np.zeros(len(values)) if step == 0.0 else np.round((np.where(finite, values, low) - low) / step) - STEPS
    changes = np.diff(np.where(finite, counts, -STEPS - 1).astype("<i2"), prepend=np.int16(0)).astype("<i2")
    planes = changes.view(np.uint8).reshape(-1, 2).T.tobytes()
    return {"low": low, "step": step, "steps": base64.b64encode(planes).decode("ascii")}


def text_of(text: str) -> str:
    """Return a text escaped for plotly.js, which reads < and & as markup."""
    return html.escape(text, quote=False).replace("\n", "<br>")
