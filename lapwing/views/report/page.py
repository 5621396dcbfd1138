"""Report as an HTML page: outcome and plots, in one file that works offline."""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from lapwing.flights.flight_data import FlightData
from lapwing.flights.flight_topics import AXES
from lapwing.flights.metrics import own_criteria
from lapwing.flights.tracking import digits, unit_and_factor
from lapwing.services.common.schemas.run_schema import published_figures
from lapwing.views.report.flight_header import MANY, differences, facts
from lapwing.views.report.key_numbers import key_numbers, trouble
from lapwing.views.report.plotly_script import gzip_base64, remove_unused_traces, script
from lapwing.views.report.sections import Section, labels, long, sections
from lapwing.views.report.style import DARK

VERDICTS = {"good": "Good", "warn": "Flawed", "bad": "Failed"}  # by the mark of an outcome
OPEN = ("timeline", "position")  # sections that are initially open
_HERE = Path(__file__).parent
_LOADER = FileSystemLoader(_HERE)
_TEMPLATES = Environment(
    loader=_LOADER, autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=StrictUndefined
)


class Accuracy(NamedTuple):
    """Row of the table of errors: an error for each flight, then the published one; "" if missing."""

    axis: str
    unit: str
    values: tuple[str, ...]


def flight_page(flights: Sequence[FlightData], view3d: bool = False) -> str:
    """Return the page of one flight, or of an overlay of two, with the 3D view if `view3d`."""
    scenes = [flight.origin.scene for flight in flights]
    published = published_figures(scenes[0])
    names, own = labels(flights), [own_criteria(flight) for flight in flights]
    tables = [facts(flight) for flight in flights]
    others = flights[0].others if len(flights) == 1 else ()
    section_iterator = sections(flights)  # each is drawn when the template reaches it
    columns = list(names) if len(flights) > 1 else ["this flight"]
    return render(
        "flight.html",
        name=" and ".join(names) if len(flights) > 1 else flights[0].metadata.get("scene") or names[0],
        others=[(other.outcome.mark, f"{other.vehicle}: {other.outcome}") for other in others],
        title=" · ".join(dict.fromkeys(filter(None, (s.get("run", {}).get("title", "") for s in scenes)))),
        labels=names if len(flights) > 1 else (),
        outcomes=[
            (
                flight.outcome.mark if all(criteria.values()) else "bad",
                f"{flight.vehicle}: {flight.outcome}" if others else flight.outcome,
            )
            for flight, criteria in zip(flights, own, strict=True)
        ],
        verdicts=VERDICTS,
        criteria=own,
        events=[flight.events for flight in flights],
        vehicle=flights[0].vehicle,
        numbers=[key_numbers(flight) for flight in flights],
        trouble=[trouble(flight) for flight in flights],
        facts={key: [one.get(key, "") for one in tables] for key in dict.fromkeys(k for one in tables for k in one)},
        differences=differences(*scenes) if len(scenes) == 2 else {},
        many=MANY,
        accuracy=accuracy(flights, published.get("rmse", {})),
        columns=columns + ([published.get("source", "published")] if published.get("rmse") else []),
        map=next(section_iterator),
        sections=section_iterator,
        open=OPEN,
        seconds=3600 if long(flights) else 1,
        view3d=_view3d_page(flights, names) if view3d else "",
        no_view3d="" if view3d else _view3d_hint(flights),
    )


def _view3d_page(flights: Sequence[FlightData], names: Sequence[str]) -> str:
    """Return the page of the 3D view as JSON text, escaped for an HTML element."""
    from lapwing.views.view3d.recording import page

    return json.dumps(page(flights, names)).replace("<", "\\u003c")


def _view3d_hint(flights: Sequence[FlightData]) -> str:
    """Return the command that shows the 3D view, or the reason why it is unavailable."""
    from lapwing.views.view3d import MISSING, available

    if not all(flight.located for flight in flights):
        return "the position is not measured"
    source = flights[0].origin.source if flights[0].origin.recorded else "LOG"
    return f"lapwing view {source} shows it" if available() else MISSING


def render(template: str, sections: Iterable[Section], **values: Any) -> str:
    """Return the page of a template of this folder, including plotly.js.

    Raises:
        ValueError: plotly is not installed.
    """
    code = (_HERE / "page.js").read_text(encoding="utf-8").replace("DARK_COLOURS", json.dumps(DARK))
    library = gzip_base64(remove_unused_traces(script()))
    return _TEMPLATES.get_template(template).render(library=library, code=code, sections=sections, **values)


def accuracy(flights: Sequence[FlightData], published: dict[str, float]) -> list[Accuracy]:
    """Return the root-mean-square errors of each axis [m], [°] and the published ones; empty without a reference."""
    if not any(flight.rmse for flight in flights):
        return []
    rows = []
    for axis in AXES:
        unit, scale = unit_and_factor(axis)
        values = [flight.rmse.get(axis) for flight in flights] + ([published.get(axis)] if published else [])
        rows.append(Accuracy(axis, unit, tuple("" if v is None else digits(scale * v) for v in values)))
    return rows
