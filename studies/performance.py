"""The performance card of a vehicle: what its models give, beside what others state (theory.md, chapter 2)."""

import json
import math
import tomllib
from pathlib import Path
from typing import NamedTuple

from rich.console import Console
from rich.table import Table

from dynamics.vehicles import performance
from dynamics.vehicles.airframe import Airframe, load_airframe
from services.common.vehicle import airframe
from services.table import load


class Row(NamedTuple):
    """One figure of the card, in the unit that it is shown in."""

    name: str
    unit: str
    computed: float
    published: float | None
    source: str
    reason: str


# name of the function and of the published figure: (unit shown, SI units in one of it)
_SHOWN = {
    "hover_time": ("min", 60.0),
    "maximum_payload": ("kg", 1.0),
    "maximum_range": ("km", 1000.0),
    "ceiling": ("km", 1000.0),
    "maximum_tilt": ("deg", math.pi / 180.0),
    "maximum_speed": ("m/s", 1.0),
}


def card(subject: Path) -> list[Row]:
    """The figures of a vehicle.

    Args:
        subject: an airframe's file, or a scene, whose vehicle is taken.

    Raises:
        ValueError: neither of the two, or an airframe without the parts that a figure needs.
    """
    vehicle = _airframe(subject)
    rows = []
    for name, (unit, size) in _SHOWN.items():
        value = getattr(performance, name)(vehicle)
        value = value[0] if isinstance(value, tuple) else value
        stated = getattr(vehicle.published, name) if vehicle.published else None
        rows.append(
            Row(
                name.replace("_", " "),
                unit,
                value / size,
                stated.value / size if stated else None,
                vehicle.published.source if vehicle.published else "",
                stated.reason if stated else "",
            )
        )
    return rows


def _airframe(subject: Path) -> Airframe:
    try:
        tables = tomllib.loads(subject.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        tables = {}
    if "rotors" in tables:  # what no scene has
        return load_airframe(subject)
    return airframe(load(subject))


def show(console: Console, rows: list[Row]) -> None:
    """Print the card."""
    source = rows[0].source
    table = Table(show_lines=True)
    table.add_column("figure")
    table.add_column("computed", justify="right")
    if source:
        table.add_column(source, justify="right")
        table.add_column("why they differ")
    for row in rows:
        cells = [f"{row.name} [{row.unit}]", f"{row.computed:.1f}"]
        if source:
            cells += ["" if row.published is None else f"{row.published:.1f}", row.reason]
        table.add_row(*cells)
    console.print(table)


def write_json(path: Path, rows: list[Row]) -> None:
    """Write the card for other programs."""
    path.write_text(json.dumps([row._asdict() for row in rows], indent=2) + "\n", encoding="utf-8")
