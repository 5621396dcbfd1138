"""The report as a page for a browser: what the flight came to, and the plots; one file that needs no network."""

import base64
import gzip
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from jinja2 import Environment, FileSystemLoader

from lapwing.cosim.config.run_config import RunConfig
from lapwing.studies.flight_data import AXES, FlightData
from lapwing.studies.report.flight_header import differences, facts
from lapwing.studies.report.motion_3d import to_json
from lapwing.studies.report.plotly_figure import script
from lapwing.studies.report.sections import Section, labels, long, sections
from lapwing.studies.tracking import shown

LOOKS = {"landed": "good", "completed": "good"}  # by kind of outcome; "bad" for all others
_HERE = Path(__file__).parent
_TEMPLATES = Environment(loader=FileSystemLoader(_HERE), autoescape=True, trim_blocks=True, lstrip_blocks=True)


class Accuracy(NamedTuple):
    """A line of the table of errors: of each flight, and what is published; None where nothing is."""

    axis: str
    unit: str
    values: tuple[float | None, ...]


def flight_page(flights: Sequence[FlightData]) -> str:
    """The page of one flight, or of two laid over each other."""
    scenes = [flight.origin.scene for flight in flights]
    published = scenes[0].get("published", {})
    names = labels(flights)
    told = [facts(flight) for flight in flights]
    heads = list(names) if len(flights) > 1 else ["this flight"]
    return render(
        "flight.html",
        name=" and ".join(names) if len(flights) > 1 else flights[0].metadata.get("scene") or names[0],
        title=" · ".join(dict.fromkeys(filter(None, (s.get("run", {}).get("title", "") for s in scenes)))),
        labels=names if len(flights) > 1 else (),
        outcomes=[(LOOKS.get(flight.outcome.kind, "bad"), flight.outcome) for flight in flights],
        events=[flight.events for flight in flights],
        facts={key: [one.get(key, "") for one in told] for key in dict.fromkeys(k for one in told for k in one)},
        differences=differences(*scenes) if len(scenes) == 2 else {},
        accuracy=accuracy(flights, published.get("rmse", {})),
        heads=heads + ([published.get("source", "published")] if published.get("rmse") else []),
        sections=sections(flights),
        seconds=3600 if long(flights) else 1,
        motion=to_json(flights),
        moving=_moving(),
    )


def live_page(setup: RunConfig, stream: str) -> str:
    """The page of a flight that goes on; the address `stream` gives what is new of it."""
    said = {"name": setup.scene, "title": setup.title, "several": len(setup.vehicles) > 1}
    return render("live.html", [], stream=stream, moving=_moving(), **said)


def _moving() -> str:
    return (_HERE / "motion.js").read_text(encoding="utf-8")


def render(template: str, sections: Iterable[Section], **values: Any) -> str:
    """The page of a template of this folder, with the script that draws its plots.

    Raises:
        ValueError: that script is not installed.
    """
    code = (_HERE / "page.js").read_text(encoding="utf-8")
    return _TEMPLATES.get_template(template).render(
        library=_compressed(script()), code=code, sections=sections, **values
    )


def _compressed(text: str) -> str:
    """Return a text compressed with gzip, in base64."""
    return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode("ascii")


def accuracy(flights: Sequence[FlightData], published: dict[str, float]) -> list[Accuracy]:
    """Root-mean-square error of each axis [m], [°] beside the published one; empty without a reference."""
    if not any(flight.rmse for flight in flights):
        return []
    found = []
    for axis in AXES:
        unit, scale = shown(axis)
        values = [flight.rmse.get(axis) for flight in flights] + ([published.get(axis)] if published else [])
        found.append(Accuracy(axis, unit, tuple(None if v is None else scale * v for v in values)))
    return found
