"""Sections of a report: the plots for which a log has the topics, and a line for each of the others."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from lapwing.studies.flight_data import FlightData
from lapwing.studies.report import plots
from lapwing.studies.report.overlay import overlay
from lapwing.studies.report.plot import NotRecordedError, Plot, in_hours
from lapwing.studies.report.plotly_figure import to_json
from lapwing.studies.report.plotly_script import gzip_base64

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
