"""Sections of a report: the plots for which a log has the topics, and a line for each of the others."""

import re
from collections.abc import Iterator, Sequence
from itertools import takewhile
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numpy as np

from lapwing.flights.flight_data import FlightData
from lapwing.views.report import plots
from lapwing.views.report.plot import Band, Line, Mark, NotRecordedError, Panel, Plot, Stretch, in_hours
from lapwing.views.report.plotly_figure import to_json
from lapwing.views.report.plotly_script import gzip_base64
from lapwing.views.report.style import BOUND, COLOURS, FLOWN

LONG = 3 * 3600.0  # [s] duration above which time is in hours


class Section(NamedTuple):
    """A plot on the page, or the reason for its absence."""

    name: str
    title: str
    plot: Plot | None = None
    missing: str = ""

    @property
    def packed(self) -> str:
        """Figure of the plot, compressed for the page."""
        return gzip_base64(to_json(self.plot)) if self.plot else ""


def sections(flights: Sequence[FlightData]) -> Iterator[Section]:
    """Yield all plots of the vehicles' models, of one flight or of an overlay of two.

    They are drawn on demand, since each holds all its samples.
    """
    models = {flight.origin.scene.get("vehicle", {}).get("model", "rigid_body") for flight in flights}
    selected = [module for module in plots.modules() if models & set(getattr(module, "MODELS", models))]
    if all(len(flight.fleet) < 2 for flight in flights):
        selected = [module for module in selected if not getattr(module, "FLEET", False)]
    return (_section(module, flights) for module in selected)


def labels(flights: Sequence[FlightData]) -> tuple[str, ...]:
    """Return distinct names of the flights: their own, or those of their logs, with folders if these are equal."""
    own = tuple(flight.name for flight in flights)
    if all(own) and len(set(own)) == len(own):
        return own
    sources = [Path(flight.origin.source) for flight in flights]
    stems = tuple(source.stem for source in sources)
    if len(set(stems)) == len(stems):
        return stems
    named = tuple(str(source.with_suffix("")) for source in sources)
    return named if len(set(named)) == len(named) else tuple("AB"[: len(flights)])


def _section(module: ModuleType, flights: Sequence[FlightData]) -> Section:
    name = module.__name__.rpartition(".")[2]
    drawn: list[tuple[str, Plot]] = []
    missing: list[str] = []
    names = labels(flights)
    for label, flight in zip(names, flights, strict=True):
        lacking = [topic for topic in module.NEEDS if not flight.has(topic)]
        try:
            if lacking:
                raise NotRecordedError(f"the log has no topic {', '.join(lacking)}")
            drawn.append((label, module.draw(flight)))
        except NotRecordedError as reason:
            missing.append(f"{label}: {reason}" if len(flights) > 1 else str(reason))
    if not drawn:
        return Section(name, module.TITLE, missing="; ".join(missing))
    plot = drawn[0][1]
    if len(drawn) == 2:
        plot = overlay(plot, drawn[1][1], (drawn[0][0], drawn[1][0]))
    elif missing:
        plot = plot._replace(caption=f"{plot.caption} Of {drawn[0][0]} alone ({'; '.join(missing)}).")
    return Section(name, module.TITLE, in_hours(plot) if long(flights) else plot)


def long(flights: Sequence[FlightData]) -> bool:
    """Return True if time is shown in hours."""
    return bool(max(flight.truth.times[-1] for flight in flights) > LONG)


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
    x_range, y_range = _union(panel.x_range, other.x_range), _union(panel.y_range, other.y_range)
    title, note = _texts(panel.title, other.title, labels, "; "), _texts(panel.note, other.note, labels, "\n")
    return panel._replace(marks=(*mine, *theirs), x_range=x_range, y_range=y_range, title=title, note=note)


def _union(*ranges: tuple[float, float] | None) -> tuple[float, float] | None:
    """Return the range that contains all ranges; None if one is None."""
    known = [each for each in ranges if each]
    return (min(low for low, _ in known), max(high for _, high in known)) if len(known) == len(ranges) else None


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
