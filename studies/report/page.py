"""The page: what the flight came to, and the plots."""

import base64
import io
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from jinja2 import Environment, FileSystemLoader
from matplotlib.figure import Figure

from studies.flight import AXES, Flight
from studies.report import plots
from studies.report.style import DPI, NotRecordedError, styled

_TEMPLATES = Environment(
    loader=FileSystemLoader(Path(__file__).parent), autoescape=True, trim_blocks=True, lstrip_blocks=True
)


class Section(NamedTuple):
    """A plot on the page: its PNG in base64 and caption, or why there is none."""

    name: str
    title: str
    png: str = ""
    caption: str = ""
    missing: str = ""


class Accuracy(NamedTuple):
    """A line of the table of errors; `published` is None where nothing is."""

    axis: str
    unit: str
    rmse: float
    published: float | None


def write(flight: Flight, target: Path) -> Path:
    """Write the report of a flight; its path.

    Raises:
        ValueError: the report cannot be written.
    """
    scene = flight.origin.scene
    published = scene.get("published", {})
    page = render(
        "flight.html",
        log=Path(flight.origin.source).name,
        title=scene.get("run", {}).get("title", ""),
        scene=flight.metadata.get("scene", ""),
        facts=facts(flight),
        accuracy=accuracy(flight, published.get("rmse", {})),
        source=published.get("source", "published") if published.get("rmse") else "",
        sections=sections(flight),
    )
    try:
        target.write_text(page, encoding="utf-8")
    except OSError as fault:
        raise ValueError(f"{target}: cannot write the report: {fault.strerror or fault}") from None
    return target


def render(template: str, **values: Any) -> str:
    """The page of a template of this folder."""
    return _TEMPLATES.get_template(template).render(**values)


def facts(flight: Flight) -> dict[str, str]:
    """What identifies the flight and how it ended, by name."""
    said = flight.metadata
    t = flight.truth.times
    found = {
        "vehicle": flight.vehicle,
        "duration": f"{t[-1] - t[0]:.2f} s",
        "landed": "yes" if flight.landed else "no",
        "seed": said.get("seed", ""),
        "mode": said.get("mode", ""),
        "solver": f"{said['solver_integrator']}, step {said['solver_step']} s" if "solver_integrator" in said else "",
        "exchange": f"{said['exchange_rate']} Hz, {said.get('coupling', '')}" if "exchange_rate" in said else "",
        "version": said.get("version", ""),
        "commit": said.get("commit", ""),
        "digest": flight.digest or "none: the log has no end",
    }
    return {name: value for name, value in found.items() if value}


def accuracy(flight: Flight, published: dict[str, float]) -> list[Accuracy]:
    """Root-mean-square error of each axis beside the published one; empty without a reference."""
    units = dict(zip(AXES, ("m", "m", "m", "rad", "rad", "rad"), strict=True))
    return [Accuracy(axis, units[axis], rmse, published.get(axis)) for axis, rmse in flight.rmse.items()]


def sections(flight: Flight) -> list[Section]:
    """Every plot of the vehicle's model that the log has the topics for, and a line for each of the others."""
    model = flight.origin.scene.get("vehicle", {}).get("model", "reduced")
    return [_section(module, flight) for module in plots.modules() if model in getattr(module, "MODELS", (model,))]


def _section(module: ModuleType, flight: Flight) -> Section:
    name = module.__name__.rpartition(".")[2]
    lacking = [topic for topic in module.NEEDS if not flight.has(topic)]
    if lacking:
        return Section(name, module.TITLE, missing=f"the log has no topic {', '.join(lacking)}")
    try:
        with styled():
            figure, caption = module.draw(flight)
            return Section(name, module.TITLE, png(figure), caption)
    except NotRecordedError as reason:
        return Section(name, module.TITLE, missing=str(reason))


def png(figure: Figure) -> str:
    """The figure as PNG in base64."""
    file = io.BytesIO()
    # Compression level 3 is faster than the usual 6; the file is a tenth larger.
    figure.savefig(file, format="png", dpi=DPI, metadata={"Software": None}, pil_kwargs={"compress_level": 3})
    return base64.b64encode(file.getvalue()).decode("ascii")
