"""A plot as an inline SVG picture, without any library."""

import html
import math

import numpy as np

from lapwing.studies.stability.case_result import Plot

WIDTH, HEIGHT = 760, 300
LEFT, RIGHT, TOP, BOTTOM = 70, 190, 12, 44
COLOURS = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#8c564b", "#17becf", "#e377c2", "#7f7f7f", "#bcbd22")
MOST = 600  # points of a line


class Axis:
    """From values to places on the page."""

    def __init__(self, values: np.ndarray, log: bool, first: float, last: float):
        self.log, self.first, self.last = log, first, last
        good = values[np.isfinite(values) & ((values > 0.0) | (not log))]
        low, high = (float(good.min()), float(good.max())) if good.size else (1.0, 10.0)
        if log:
            low, high = float(math.floor(math.log10(low) + 1e-9)), float(math.ceil(math.log10(high) - 1e-9))
        if low == high:
            low, high = low - 1.0, high + 1.0
        self.low, self.high = low, high

    def place(self, values: np.ndarray) -> np.ndarray:
        """Places of values; NaN for what a logarithm cannot show."""
        with np.errstate(divide="ignore", invalid="ignore"):
            found = np.log10(np.where(values > 0.0, values, np.nan)) if self.log else values
        return self.first + (found - self.low) / (self.high - self.low) * (self.last - self.first)

    def ticks(self) -> list[tuple[float, str]]:
        """(place, text) of about six marks."""
        if self.log:
            decades = max(1, round((self.high - self.low) / 6))
            values = np.arange(self.low, self.high + 0.5, decades)
            return [(float(self.place(np.array(10.0**v))), f"1e{int(v)}") for v in values]
        rough = (self.high - self.low) / 5
        step = 10.0 ** math.floor(math.log10(rough))
        step *= next(k for k in (1.0, 2.0, 5.0, 10.0) if k * step >= rough)
        values = np.arange(math.ceil(self.low / step) * step, self.high + 1e-9 * step, step)
        return [(float(self.place(np.array(v))), f"{v + 0.0:.6g}") for v in values]


def chart(plot: Plot) -> str:
    """The SVG element."""
    every = [np.asarray(c.y, dtype=float) for c in plot.curves]
    bound = [] if plot.bound is None else [np.array([plot.bound])]
    x = Axis(
        np.concatenate([np.asarray(c.x, dtype=float) for c in plot.curves] or [np.zeros(1)]),
        plot.log_x,
        LEFT,
        WIDTH - RIGHT,
    )
    y = Axis(np.concatenate([*every, *bound] or [np.zeros(1)]), plot.log_y, HEIGHT - BOTTOM, TOP)
    parts = [
        f'<rect x="{LEFT}" y="{TOP}" width="{WIDTH - RIGHT - LEFT}" height="{HEIGHT - BOTTOM - TOP}" class="frame"/>'
    ]
    for at, text in x.ticks():
        parts.append(f'<text x="{at:.1f}" y="{HEIGHT - BOTTOM + 16}" text-anchor="middle">{text}</text>')
    for at, text in y.ticks():
        parts.append(f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{at:.1f}" y2="{at:.1f}" class="grid"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{at + 4:.1f}" text-anchor="end">{text}</text>')
    middle = 0.5 * (LEFT + WIDTH - RIGHT)
    parts.append(f'<text x="{middle}" y="{HEIGHT - 8}" text-anchor="middle">{html.escape(plot.x_label)}</text>')
    parts.append(
        f'<text transform="translate(14 {0.5 * (TOP + HEIGHT - BOTTOM)}) rotate(-90)" text-anchor="middle">'
        f"{html.escape(plot.y_label)}</text>"
    )
    if plot.bound is not None and not (plot.log_y and plot.bound <= 0.0):
        at = float(y.place(np.array(plot.bound)))
        parts.append(f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{at:.1f}" y2="{at:.1f}" class="bound"/>')
        parts.append(f'<text x="{WIDTH - RIGHT + 8}" y="{at + 4:.1f}" class="bound">bound {plot.bound:.2g}</text>')
    for k, curve in enumerate(plot.curves):
        colour = COLOURS[k % len(COLOURS)]
        parts += _line(x.place(np.asarray(curve.x, dtype=float)), y.place(every[k]), colour)
        at = TOP + 14 + 17 * k
        parts.append(f'<rect x="{WIDTH - RIGHT + 8}" y="{at - 8}" width="12" height="4" fill="{colour}"/>')
        parts.append(f'<text x="{WIDTH - RIGHT + 26}" y="{at - 2}">{html.escape(curve.name)}</text>')
    return f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" xmlns="http://www.w3.org/2000/svg">{"".join(parts)}</svg>'


def _line(x: np.ndarray, y: np.ndarray, colour: str) -> list[str]:
    """Pieces between what cannot be shown; a single point is a dot."""
    every = max(1, len(x) // MOST)
    x, y = x[::every], y[::every]
    good = np.isfinite(x) & np.isfinite(y)
    pieces = np.split(np.arange(len(x)), np.flatnonzero(np.diff(good.astype(int))) + 1) if len(x) else []
    parts = []
    for piece in (p for p in pieces if good[p[0]]):
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x[piece], y[piece], strict=True))
        parts.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.6"/>')
        if len(piece) <= 40:
            parts += [
                f'<circle cx="{a:.1f}" cy="{b:.1f}" r="2.2" fill="{colour}"/>'
                for a, b in zip(x[piece], y[piece], strict=True)
            ]
    return parts
