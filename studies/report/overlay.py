"""Two flights in one plot: the second in other colours, its names with the flight's own."""

import numpy as np

from studies.report.plot import Band, Mark, Panel, Plot, Stretch
from studies.report.style import BOUND, COLOURS, FLOWN

# Of the second flight, by the colour of the first; what is not here keeps its colour and is dotted all the same.
SECOND = {FLOWN: BOUND, BOUND: "#F0A070", **dict(zip(COLOURS[1:4], ("#7A5200", "#66C2A5", "#7B3F61"), strict=True))}


def overlay(first: Plot, second: Plot, labels: tuple[str, str]) -> Plot:
    """Both in one; a panel that only one has stays as it is, one that only the second has is not shown, and told."""
    others = {_key(panel): panel for panel in second.panels}
    panels = []
    for panel in first.panels:
        other = others.pop(_key(panel), None)
        panels.append(panel if other is None else _both(panel, other, labels))
    spans = [plot.span for plot in (first, second) if plot.span]
    span = (min(s for s, _ in spans), max(e for _, e in spans)) if spans else None
    if first.caption == second.caption:
        caption = first.caption
    else:
        caption = f"{labels[0]}: {first.caption} {labels[1]}: {second.caption}"
    if first.phases:
        caption += f" Phases are those of {labels[0]}."
    if others:
        caption += f" Only in {labels[1]}, and not shown: {', '.join(p.y_label for p in others.values())}."
    height = max(first.height, second.height)
    if any(isinstance(mark, Stretch) for panel in panels for mark in panel.marks):  # a lane for each flight
        height = first.height + second.height - 1.0
    return first._replace(panels=tuple(panels), span=span, caption=caption, height=height)


def _key(panel: Panel) -> tuple:
    return panel.row, panel.column, panel.y_label


def _both(panel: Panel, other: Panel, labels: tuple[str, str]) -> Panel:
    shared = [mark for mark in other.marks if any(_same(mark, own) for own in panel.marks)]
    mine = [m if any(_same(m, s) for s in shared) else _named(m, labels[0]) for m in panel.marks]
    theirs = [_recoloured(_named(m, labels[1])) for m in other.marks if not any(m is s for s in shared)]
    ranges = [p.y_range for p in (panel, other) if p.y_range]
    y_range = (min(low for low, _ in ranges), max(high for _, high in ranges)) if len(ranges) == 2 else None
    title, note = (
        a if a == b else "; ".join(f"{label}: {text}" for label, text in zip(labels, (a, b), strict=True) if text)
        for a, b in ((panel.title, other.title), (panel.note, other.note))
    )
    return panel._replace(marks=(*mine, *theirs), y_range=y_range, title=title, note=note)


def _same(one: Mark, other: Mark) -> bool:
    """Whether two marks show the same: limits, a reference that both followed."""
    return type(one) is type(other) and all(
        np.array_equal(a, b) if isinstance(a, np.ndarray) and isinstance(b, np.ndarray) else a is b or a == b
        for a, b in zip(one, other, strict=True)
    )


def _named(mark: Mark, label: str) -> Mark:
    if isinstance(mark, Stretch):
        return mark._replace(lane=f"{mark.lane}, {label}")
    return mark._replace(name=f"{mark.name}, {label}" if mark.name else label)


def _recoloured(mark: Mark) -> Mark:
    mark = mark._replace(colour=SECOND.get(mark.colour, mark.colour))
    return mark if isinstance(mark, (Stretch, Band)) or mark.dash != "solid" else mark._replace(dash="dot")
