"""Map of the flight: path, reference, plan, fence, obstacles, wind, and positions of adverse events."""

from collections.abc import Iterator

import numpy as np

from lapwing.flights.flight_data import FlightData
from lapwing.flights.plan_shapes import fence_shapes, waypoints
from lapwing.views.report.flight_phases import check_measured
from lapwing.views.report.key_numbers import trouble
from lapwing.views.report.plot import Line, Panel, Plot, reference
from lapwing.views.report.style import AXIS_COLOURS, BOUND, COLOURS, FLOWN, QUIET

ORDER = -10
TITLE = "Mission map"
NEEDS = ("ground_truth",)
ARROW = 0.16  # length of the wind arrow, relative to the map
HEAD = 0.25  # length of the arrow's head, relative to the arrow
FENCE = 4.0  # largest extent of a fence that widens the map, relative to the flight
LEAST = 2.0  # [m] minimum extent of the map, so that a hover does not show noise as a path


def draw(flight: FlightData) -> Plot:
    """Plot the plan view, north up."""
    x, y, _ = flight.truth.position.T
    check_measured("the position", flight.truth.position)
    name, colour = "flown", FLOWN
    if len(flight.fleet) > 1:
        name, colour = flight.vehicle, COLOURS[list(flight.fleet).index(flight.vehicle) % len(COLOURS)]
    marks = [*_obstacles(flight), Line(x, y, name, colour, width=2.2)]
    if len(flight.reference):
        marks.append(reference(*flight.reference.T[:2]))
    if len(points := waypoints(flight)):
        east, north, _ = points.T
        marks.append(Line(east, north, "plan", COLOURS[3], 1.0, "dot", marker="open", size=6.0))
    marks.append(Line(x[:1], y[:1], "start", AXIS_COLOURS[2], marker="open", size=9.0, joined=False))
    marks.append(Line(x[-1:], y[-1:], "end", FLOWN, marker="square", size=8.0, joined=False))
    marks += _events(flight)
    marks += _others(flight)
    low, high = _extent(marks)
    fence = list(_fence(flight))
    caption = ""
    if fence:
        fence_low, fence_high = _extent([*marks, *fence])
        if (fence_high - fence_low).max() <= FENCE * (high - low).max():
            low, high = fence_low, fence_high
        else:
            caption = "The fence extends beyond this map; zoom out to see all of it."
    marks += [*fence, *_wind(flight, low, high)]
    panel = Panel(tuple(marks), "y north [m]", "x east [m]", timed=False, equal=True)
    panel = panel._replace(x_range=(float(low[0]), float(high[0])), y_range=(float(low[1]), float(high[1])))
    return Plot((panel,), caption, 4.6)


def _others(flight: FlightData) -> Iterator[Line]:
    """Yield the paths of the other vehicles of a fleet."""
    for i, (name, truth) in enumerate(flight.fleet.items()):
        if name != flight.vehicle:
            x, y, _ = truth.position.T
            yield Line(x, y, name, COLOURS[i % len(COLOURS)], 1.2)


def _extent(lines: list[Line]) -> tuple[np.ndarray, np.ndarray]:
    """Return the south-west and north-east corner around lines with a margin [m], shape (2,) each."""
    points = np.concatenate([np.column_stack([line.x, line.y]) for line in lines])
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    middle, half = 0.5 * (low + high), np.maximum(0.6 * (high - low), 0.5 * LEAST)
    return middle - half, middle + half


def _events(flight: FlightData) -> Iterator[Line]:
    """Yield a line of markers for each kind of adverse event, at the positions of the vehicle."""
    t, position = flight.truth.times, flight.truth.position
    times: dict[str, list[float]] = {}
    for event in trouble(flight):
        times.setdefault(event.kind, []).append(event.time)
    for index, (kind, event_times) in enumerate(times.items()):
        rows = np.searchsorted(t, event_times).clip(max=len(t) - 1)
        marker = ("cross", "diamond", "triangle", "circle")[index % 4]
        yield Line(position[rows, 0], position[rows, 1], kind, BOUND, marker=marker, size=9.0, joined=False)


def _fence(flight: FlightData) -> Iterator[Line]:
    for shape in fence_shapes(flight):
        east, north = np.vstack([shape.corners, shape.corners[:1]]).T
        name, colour = ("fence: stay in", AXIS_COLOURS[2]) if shape.stay_in else ("fence: keep out", BOUND)
        yield Line(east, north, name, colour, 1.2, "dashdot")


def _obstacles(flight: FlightData) -> Iterator[Line]:
    """Yield the outlines of the boxes and cylinders of the terrain."""
    terrain = flight.origin.scene.get("environment", {}).get("terrain") or {}
    for box in terrain.get("box") or ():
        half = 0.5 * np.array(box["size"], float)
        corners = half * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)])
        c, s = np.cos(box.get("heading", 0.0)), np.sin(box.get("heading", 0.0))
        east, north = (corners @ np.array([[c, s], [-s, c]]) + np.array(box["position"], float)).T
        yield Line(east, north, "obstacle", QUIET, 1.0, fill=QUIET)
    angle = np.linspace(0.0, 2.0 * np.pi, 37)
    for post in terrain.get("cylinder") or ():
        (x, y), radius = post["position"], post["radius"]
        yield Line(x + radius * np.cos(angle), y + radius * np.sin(angle), "obstacle", QUIET, 1.0, fill=QUIET)


def _wind(flight: FlightData, low: np.ndarray, high: np.ndarray) -> Iterator[Line]:
    """Yield an arrow along the mean horizontal wind in the north-west corner; nothing in still air."""
    if "wind" not in flight.truth.fields:
        return
    mean = flight.truth.wind[:, :2].mean(axis=0)
    speed = float(np.hypot(*mean))
    if not speed > 0.05:
        return
    length = ARROW * float((high - low).max())
    along = mean / speed * length
    across = np.array([-along[1], along[0]])
    corner = np.array([low[0], high[1]]) + np.array([0.75, -0.75]) * length
    tail, tip = corner - 0.5 * along, corner + 0.5 * along
    barbs = [tip - HEAD * along + sign * 0.6 * HEAD * across for sign in (1.0, -1.0)]
    east, north = np.array([tail, tip, barbs[0], tip, barbs[1]]).T
    yield Line(east, north, f"mean wind {speed:.1f} m/s", COLOURS[4], 2.4)
