"""Overlay of two flights in one plot, with different colours and the flights' names in the legend."""

import re
from itertools import takewhile

import numpy as np

from lapwing.studies.report.plot import Band, Line, Mark, Panel, Plot, Stretch
from lapwing.studies.report.style import BOUND, COLOURS, FLOWN

# Colours of the first and of the second flight by those in the plot of one flight; other colours are unchanged.
FIRST = {BOUND: FLOWN}
SECOND = {FLOWN: BOUND, **dict(zip(COLOURS[1:4], ("#7A5200", "#66C2A5", "#7B3F61"), strict=True))}
LANE = 0.32  # [inch] height of a timeline's lane


def overlay(first: Plot, second: Plot, labels: tuple[str, str]) -> Plot:
    """Return two plots in one. Panels of the first alone are kept, those of the second alone are only named."""
    others = {_key(panel): panel for panel in second.panels}
    panels, apart, named = [], _differing_names(first, second), (_colours_in_legend(first), _colours_in_legend(second))
    for panel in first.panels:
        other = others.pop(_key(panel), None)
        panels.append(panel if other is None else _both(panel, other, labels, named, apart))
    spans = [plot.span for plot in (first, second) if plot.span]
    span = (min(s for s, _ in spans), max(e for _, e in spans)) if spans else None
    caption = _captions(first.caption, second.caption, labels)
    if any(" / " in panel.title and " / " not in own.title for panel, own in zip(panels, first.panels, strict=True)):
        caption += f" Above the panels: {labels[0]} / {labels[1]}."
    if first.phases:
        caption += f" The phases are those of {labels[0]}."
    if others:
        caption += f" Only in {labels[1]}, not shown: {', '.join(p.y_label for p in others.values())}."
    added = sum(len(_lanes(panel)) for panel in panels) - sum(len(_lanes(panel)) for panel in first.panels)
    height = max(first.height, second.height) + LANE * added
    return first._replace(panels=tuple(panels), span=span, caption=caption, height=height)


def _key(panel: Panel) -> tuple:
    return panel.row, panel.column, panel.y_label


def _colours_in_legend(plot: Plot) -> set[str]:
    """Return the colours of the solid lines in the legend of a plot."""
    lines = [mark for panel in plot.panels for mark in panel.marks if isinstance(mark, Line)]
    return {line.colour for line in lines if line.name and line.dash == "solid"}


def _differing_names(first: Plot, second: Plot) -> set[str]:
    """Return the names of marks that differ between the flights in any panel, which the legend lists per flight."""
    others = {_key(panel): panel.marks for panel in second.panels}
    pairs = [(panel.marks, others[_key(panel)]) for panel in first.panels if _key(panel) in others]
    both = [*pairs, *((b, a) for a, b in pairs)]
    differing = [m for own, theirs in both for m in own if not any(_same(m, other) for other in theirs)]
    return {m.name for m in differing if not isinstance(m, Stretch) and m.name}


def _both(
    panel: Panel, other: Panel, labels: tuple[str, str], named: tuple[set[str], set[str]], apart: set[str]
) -> Panel:
    ours, others = _lanes(panel), _lanes(other)
    shared = [mark for mark in other.marks if any(_same(mark, own) for own in panel.marks)]
    shared = [m for m in shared if isinstance(m, Stretch) or m.name not in apart]
    shared = [m for m in shared if not isinstance(m, Stretch) or ours[m.lane] == others[m.lane]]
    mine = [m if any(_same(m, s) for s in shared) else _of(m, labels[0], FIRST, "solid", named[0]) for m in panel.marks]
    theirs = [_of(m, labels[1], SECOND, "dot", named[1]) for m in other.marks if not any(m is s for s in shared)]
    ranges = [p.y_range for p in (panel, other) if p.y_range]
    y_range = (min(low for low, _ in ranges), max(high for _, high in ranges)) if len(ranges) == 2 else None
    title, note = _texts(panel.title, other.title, labels, "; "), _texts(panel.note, other.note, labels, "\n")
    return panel._replace(marks=(*mine, *theirs), y_range=y_range, title=title, note=note)


def _texts(one: str, other: str, labels: tuple[str, str], between: str) -> str:
    """Return two texts in one: with a common beginning "RMSE 0.12 m / 0.15 m", otherwise each with its flight."""
    if one == other:
        return one
    first, second = one.split(" "), other.split(" ")
    shared = len(list(takewhile(lambda pair: pair[0] == pair[1], zip(first, second, strict=False))))
    if shared:
        return " ".join([*first, "/", *second[shared:]])
    return between.join(f"{label}: {text}" for label, text in zip(labels, (one, other), strict=True) if text)


def _captions(one: str, other: str, labels: tuple[str, str]) -> str:
    """Return two captions in one: first the common sentences, then those of each flight."""
    first, second = (re.split(r"(?<=\.) ", text) for text in (one, other))
    parts = [sentence for sentence in first if sentence in second]
    for label, own, others in ((labels[0], first, second), (labels[1], second, first)):
        if rest := [sentence for sentence in own if sentence not in others]:
            parts.append(f"{label}: {' '.join(rest)}")
    return " ".join(parts)


def _same(one: Mark, other: Mark) -> bool:
    """Return True if two marks are equal, such as limits or a common reference."""
    return type(one) is type(other) and all(
        np.array_equal(a, b) if isinstance(a, np.ndarray) and isinstance(b, np.ndarray) else a is b or a == b
        for a, b in zip(one, other, strict=True)
    )


def _lanes(panel: Panel) -> dict[str, list[Stretch]]:
    """Return the bars of each lane of a timeline."""
    lanes: dict[str, list[Stretch]] = {}
    for mark in panel.marks:
        if isinstance(mark, Stretch):
            lanes.setdefault(mark.lane, []).append(mark)
    return lanes


def _of(mark: Mark, label: str, colours: dict[str, str], dash: str, named: set[str]) -> Mark:
    """Return the mark with its flight's name and style; dashed lines stay dashed.

    A mark without a name gets that of its flight, unless the legend already names a line of its colour.
    """
    if isinstance(mark, Stretch):
        return mark._replace(lane=f"{mark.lane}, {label}")
    own = "" if mark.colour in named else label
    mark = mark._replace(name=f"{mark.name}, {label}" if mark.name else own)
    mark = mark._replace(colour=colours.get(mark.colour, mark.colour))
    return mark if isinstance(mark, Band) or mark.dash != "solid" else mark._replace(dash=dash)
