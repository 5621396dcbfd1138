"""Diagram of the services of a run, their connections, and the auxiliary processes."""

import math
from pathlib import Path
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from lapwing.cosim.config.run_config import RunConfig
from lapwing.services.process_table import MAVLINK, PROCESSES, ProcessEntry
from lapwing.views.report.style import DPI, FLOWN

GREY, PALE = "#666666", "#F4F6F8"
DISTANCE_X, DISTANCE_Y = 6.6, 3.9  # between the centres of services
HALF = (1.05, 0.8)  # half the width and height of a service
LISTENER_HALF_WIDTH, LISTENER_HALF_HEIGHT = 0.95, 0.35  # of an auxiliary process
OVERHANG = 0.9  # of the row of auxiliary processes beyond the centres of the outer services
ARROW_DISTANCE = 0.32  # between the arrows of two services
PLACES = {"plant": (0, 1), "sensors": (1, 1), "trajectory": (0, 0), "autopilot": (1, 0), "formation": (1, 0)}
LISTENER_INPUTS = {"recorder": "every recorded topic", MAVLINK: "telemetry"}  # otherwise: every topic
STATION, LINK = "ground station", "MAVLink 2"
TOP, BOTTOM, LAST, ASIDE = -1.15, -3.0, -5.0, 0.7  # y of the rows below the services; x of arrows off the centre
NOTE = "* input delay of one or more ticks\nsolid: lock step; dashed: started by an option"

Point = tuple[float, float]


class Arrow(NamedTuple):
    """Data that flows one way between two boxes."""

    start: Point
    end: Point
    text: str
    colour: str = FLOWN
    both_ways: bool = False


def ports_by_pair(config: RunConfig) -> dict[tuple[str, str], list[str]]:
    """Return the names of the ports of each pair (producer, consumer), with "*" if the input is delayed."""
    result: dict[tuple[str, str], list[str]] = {}
    producers = config.producers
    for name, service in config.services.items():
        for port_read in service.inputs:
            result.setdefault((producers[port_read.port], name), []).append(
                port_read.port + ("*" if port_read.delay else "")
            )
    return result


def listeners(config: RunConfig) -> list[ProcessEntry]:
    """Return the auxiliary processes; the MAVLink link only with an autopilot."""
    return [p for p in PROCESSES if not p.lock_step and (not p.resolves or p.name in config.auxiliary)]


def places(config: RunConfig) -> dict[str, Point]:
    """Return the centre of each service."""
    return {
        name: (DISTANCE_X * x, DISTANCE_Y * y) for name in config.services for x, y in [PLACES.get(name, (0.5, 0.5))]
    }


def arrows(config: RunConfig) -> list[Arrow]:
    """Return an arrow for each port between services, and the arrows of auxiliary processes."""
    at, pairs, result = places(config), ports_by_pair(config), []
    for one, other in dict.fromkeys((min(pair), max(pair)) for pair in pairs):
        ways = [(one, other, text) for text in pairs.get((one, other), ())]
        ways += [(other, one, text) for text in pairs.get((other, one), ())]
        for k, (producer, consumer, text) in enumerate(ways):
            offset = ARROW_DISTANCE * (k - 0.5 * (len(ways) - 1))
            result.append(Arrow(*_beside(at[producer], at[consumer], offset if producer == one else -offset), text))
    for entry, (x, y) in _listening(config).items():
        steers = entry.name == MAVLINK
        left, label = x - ASIDE * steers, LISTENER_INPUTS.get(entry.name, "every topic")
        result.append(Arrow((left, TOP), (left, y + LISTENER_HALF_HEIGHT), label, GREY))
        if steers:
            result.append(Arrow((x + ASIDE, y + LISTENER_HALF_HEIGHT), (x + ASIDE, TOP), "commands", GREY))
            result.append(
                Arrow((x, y - LISTENER_HALF_HEIGHT), (x, LAST + LISTENER_HALF_HEIGHT), LINK, GREY, both_ways=True)
            )
    return result


def draw(config: RunConfig, path: Path) -> None:
    """Write the diagram of a run in the format of the file name's extension."""
    figure = Figure(figsize=(9.4, 9.0))
    axes = figure.add_subplot(aspect="equal")
    axes.set(xlim=(-1.9, DISTANCE_X + 1.9), ylim=(LAST - 1.3, DISTANCE_Y + 1.4))
    axes.axis("off")
    axes.set_title(f"{config.scene}: {config.rate} Hz, {config.coupling}")
    area = FancyBboxPatch((-1.4, TOP + 0.1), DISTANCE_X + 2.8, DISTANCE_Y + 2.2, "round,pad=0.1", fc=PALE, ec="none")
    axes.add_patch(area)
    for name, place in places(config).items():
        _box(axes, place, name, FLOWN, HALF)
    for entry, place in _listening(config).items():
        _box(
            axes, place, entry.name, GREY, (LISTENER_HALF_WIDTH, LISTENER_HALF_HEIGHT), "--" if entry.optional else "-"
        )
        if entry.name == MAVLINK:
            _box(axes, (place[0], LAST), STATION, GREY, (1.4, LISTENER_HALF_HEIGHT), ":")
    for arrow in arrows(config):
        _arrow(axes, arrow)
    axes.text(-1.4, LAST - 0.9, NOTE, ha="left", va="center", fontsize=8, color=GREY)
    figure.savefig(path, dpi=DPI, bbox_inches="tight")


def _listening(config: RunConfig) -> dict[ProcessEntry, Point]:
    beside = listeners(config)
    step = (DISTANCE_X + 2.0 * OVERHANG) / max(len(beside) - 1, 1)
    return {entry: (step * k - OVERHANG, BOTTOM) for k, entry in enumerate(beside)}


def _beside(start: Point, end: Point, offset: float) -> tuple[Point, Point]:
    """Return the line between the edges of two services, offset to the left of the line between their centres."""
    dx, dy = end[0] - start[0], end[1] - start[1]
    length = math.hypot(dx, dy)
    x, y = -dy / length * offset, dx / length * offset
    return _edge(start, (x, y), (dx, dy)), _edge(end, (x, y), (-dx, -dy))


def _edge(middle: Point, at: Point, way: Point) -> Point:
    """Return the point where a line from `at`, relative to the centre of a service, leaves its box along `way`."""
    shares = [(half * math.copysign(1.0, d) - p) / d for half, p, d in zip(HALF, at, way, strict=True) if abs(d) > 1e-9]
    share = min(shares)
    return middle[0] + at[0] + share * way[0], middle[1] + at[1] + share * way[1]


def _arrow(axes: Axes, arrow: Arrow) -> None:
    """Draw an arrow with its text, which is parallel to it between services."""
    looks = {"arrowstyle": "<|-|>" if arrow.both_ways else "-|>", "color": arrow.colour, "lw": 1.4}
    axes.annotate("", arrow.end, arrow.start, arrowprops={**looks, "shrinkA": 0, "shrinkB": 0})
    (x0, y0), (x1, y1) = arrow.start, arrow.end
    angle = math.degrees(math.atan2(y1 - y0, x1 - x0))
    angle += 180.0 if angle > 90.0 else -180.0 if angle <= -90.0 - 1e-9 else 0.0
    angle = angle if arrow.colour == FLOWN else 0.0
    place = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    background = {"fc": PALE if arrow.colour == FLOWN else "white", "ec": "none", "pad": 0.8}
    axes.text(
        *place, arrow.text, rotation=angle, ha="center", va="center", fontsize=8, color=GREY, bbox=background, zorder=4
    )


def _box(axes: Axes, place: Point, name: str, colour: str, half: Point, line: str = "-") -> None:
    corner, size = (place[0] - half[0], place[1] - half[1]), (2.0 * half[0], 2.0 * half[1])
    edge = {"fc": "white", "ec": colour, "lw": 1.8, "ls": line}
    axes.add_patch(FancyBboxPatch(corner, *size, boxstyle="round,pad=0,rounding_size=0.12", **edge))  # type: ignore[arg-type]
    axes.text(*place, name, ha="center", va="center", fontsize=12, zorder=5)
