"""A picture of the services of a run, what they hand to one another, and who listens."""

from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from cosim.setup import Setup
from services.processes import MAVLINK, PROCESSES, ProcessEntry
from studies.report.style import DPI, FLOWN

GREY, PALE = "#666666", "#F4F6F8"
WIDE, HIGH = 4.6, 2.4  # from service to service
PLACES = {"plant": (0, 1), "sensors": (1, 1), "trajectory": (0, 0), "autopilot": (1, 0), "formation": (1, 0)}
TAKEN = {"recorder": "every recorded topic", "router": "every topic", MAVLINK: "telemetry"}  # by those who listen
TOP, BOTTOM, ASIDE = -0.1, -2.5, 0.45  # arrows to those who listen: from, to, beside the middle
NOTE = "* taken one or more ticks after it was given\nsolid: lock step; dashed outline: only where it is asked for"

Point = tuple[float, float]


def handed(setup: Setup) -> dict[tuple[str, str], list[str]]:
    """The ports for each pair (producer, consumer); "*" behind those that are taken later."""
    found: dict[tuple[str, str], list[str]] = {}
    producers = setup.producers
    for name, service in setup.services.items():
        for taken in service.inputs:
            found.setdefault((producers[taken.port], name), []).append(taken.port + ("*" if taken.delay else ""))
    return found


def listeners(setup: Setup) -> list[ProcessEntry]:
    """The processes that stand outside of the lock step; the MAVLink link where somebody steers."""
    return [p for p in PROCESSES if not p.lock_step and (not p.resolves or p.name in setup.beside)]


def draw(setup: Setup, path: Path) -> None:
    """Write the picture of a run in the format of the file's ending."""
    figure = Figure(figsize=(9.4, 6.4))
    axes = figure.add_subplot()
    at = {name: PLACES.get(name, (0.5, 0.5)) for name in setup.services}
    places = {name: (WIDE * x, HIGH * y) for name, (x, y) in at.items()}
    axes.add_patch(FancyBboxPatch((-1.0, -0.6), WIDE + 2.0, HIGH + 1.2, "round,pad=0.1", fc=PALE, ec="none"))
    pairs = handed(setup)
    for (producer, consumer), names in pairs.items():
        share = 0.3 if (consumer, producer) in pairs else 0.5  # names for both ways must not meet
        _arrow(axes, places[producer], places[consumer], "\n".join(names), FLOWN, share)
    for name, place in places.items():
        _box(axes, place, name, FLOWN)
    beside = listeners(setup)
    for k, entry in enumerate(beside):
        x, steers = WIDE * k / max(len(beside) - 1, 1), entry.name == MAVLINK
        _arrow(axes, (x - ASIDE * steers, TOP), (x - ASIDE * steers, BOTTOM), TAKEN[entry.name], GREY)
        if steers:
            _arrow(axes, (x + ASIDE, BOTTOM), (x + ASIDE, TOP), "commands", GREY)
        _box(axes, (x, BOTTOM), entry.name, GREY, "--" if entry.optional else "-")
    axes.text(0.5 * WIDE, BOTTOM - 1.0, NOTE, ha="center", fontsize=7.5, color=GREY)
    axes.set(
        xlim=(-1.3, WIDE + 1.3),
        ylim=(BOTTOM - 1.1, HIGH + 0.8),
        title=f"{setup.scene}: {setup.rate} Hz, {setup.coupling}",
    )
    axes.axis("off")
    figure.savefig(path, dpi=DPI, bbox_inches="tight")


def _arrow(axes: Axes, start: Point, end: Point, text: str, colour: str, share: float = 0.5) -> None:
    """An arrow with a text at a `share` of its length."""
    looks = {"arrowstyle": "-|>", "color": colour, "lw": 1.6, "shrinkA": 30, "shrinkB": 30}
    axes.annotate("", end, start, arrowprops=looks)
    there = (start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1]))
    words: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 8, "color": GREY, "zorder": 4}
    axes.text(*there, text, backgroundcolor="white", **words)


def _box(axes: Axes, place: Point, name: str, colour: str, line: str = "-") -> None:
    style = {"boxstyle": "round,pad=0.6", "fc": "white", "ec": colour, "lw": 1.8, "ls": line}
    axes.text(*place, name, ha="center", va="center", fontsize=12, bbox=style, zorder=5)
