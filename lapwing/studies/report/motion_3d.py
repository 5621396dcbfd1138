"""A flight as it is shown in space: bodies that move, as lines of their own frames, and what belongs to them."""

import base64
import json
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from lapwing.studies.flight_data import FlightData
from lapwing.studies.flight_events import Event
from lapwing.studies.report import shapes
from lapwing.studies.report.sections import labels
from lapwing.studies.report.style import BOUND, COLOURS, FLOWN, REFERENCE

FRAMES = 1500  # of a flight at most; the browser goes evenly between two
FLEET_FRAMES = 15_000  # of all vehicles of a fleet together
STEP_FRAMES, LEAST = 12, 4  # of what is new in a flight that goes on; of each vehicle of a large fleet
LEVEL = (0.0, 0.0, 0.0, 1.0)  # x, y, z, w


class Stroke(NamedTuple):
    """A line through points of a body's frame, shape (m, 3) [m]."""

    points: np.ndarray
    colour: str = REFERENCE
    width: float = 4.0  # [pixel]


class Rotor(NamedTuple):
    """A propeller that turns about z of its body's frame."""

    hub: np.ndarray  # (3,) [m]
    radius: float  # [m]
    angle: np.ndarray | None = None  # [rad] at the times of the truth (n,); None: its body turns


class Surface(NamedTuple):
    """Triangles of a body's frame."""

    vertices: np.ndarray  # (n, 3) [m]
    faces: np.ndarray  # (m, 3) rows of `vertices`
    colour: str


class Body(NamedTuple):
    """Something that moves as a whole."""

    name: str
    times: np.ndarray  # [s], shape (n,)
    position: np.ndarray  # world [m], shape (n, 3)
    orientation: np.ndarray  # x, y, z, w, shape (n, 4)
    strokes: tuple[Stroke, ...]
    rotors: tuple[Rotor, ...] = ()
    force: np.ndarray | None = None  # of contacts or joints, world [N], shape (n, 3)
    surface: Surface | None = None


class Link(NamedTuple):
    """A line that joins two bodies: a rigid link, or a cable, which is slack while the second feels no force."""

    first: int  # place of the body among all
    second: int
    fastened: tuple[float, float, float] = (0.0, 0.0, 0.0)  # [m] to the first, in its frame; to the second's origin
    length: float = 0.0  # [m] of a cable without tension; 0 of a rigid link


class Motion(NamedTuple):
    """All bodies of a flight, and what joins them."""

    bodies: tuple[Body, ...]
    links: tuple[Link, ...] = ()


def motion(flight: FlightData) -> Motion:
    """Return the moving bodies of a flight, in the shape of its vehicle model, otherwise three axes."""
    model = flight.origin.scene.get("vehicle", {}).get("model", "rigid_body")
    for module in shapes.modules():
        if model in module.MODELS:
            found = module.draw(flight)
            if found is not None:
                return found
    colours = ("#D55E00", "#009E73", "#0072B2")
    axes = tuple(Stroke(np.array([(0.0,) * 3, axis]), colour) for axis, colour in zip(np.eye(3), colours, strict=True))
    return Motion((of_truth(flight, axes),))


def of_truth(
    flight: FlightData, strokes: tuple[Stroke, ...], rotors: tuple[Rotor, ...] = (), surface: Surface | None = None
) -> Body:
    """The vehicle as one body."""
    truth = flight.truth
    return Body(flight.vehicle, truth.times, truth.position, truth.orientation, strokes, rotors, None, surface)


def of_bodies(flight: FlightData, drawn: Sequence[tuple[tuple[Stroke, ...], tuple[Rotor, ...]]]) -> tuple[Body, ...]:
    """The bodies of the topic of that name, in its order, with strokes and rotors of each."""
    said = flight.topic("body_states")
    names = said["name"][0]
    return tuple(
        Body(names[k], said.times, said.position[:, k], said.orientation[:, k], *looks, said.force[:, k])
        for k, looks in enumerate(drawn)
    )


def to_json(flights: Sequence[FlightData]) -> str:
    """Motions of a flight with its fleet, or of two laid over each other, for the browser (motion.js); safe within an
    HTML element."""
    if len(flights) == 1:
        shown = [flights[0], *flights[0].others]
        order = list(flights[0].fleet)
        names = [flight.vehicle for flight in shown]
        colours = [_colour(order.index(name)) for name in names]
    else:
        shown, names, colours = list(flights), list(labels(flights)), [FLOWN, BOUND]
    frames = min(FRAMES, FLEET_FRAMES // len(shown))
    found = [_table(*each, frames) for each in zip(shown, names, colours, strict=True)]
    longest = max(float(flight.truth.times[-1]) for flight in shown)
    return json.dumps({"end": longest, "flights": found}, separators=(",", ":")).replace("<", "\\u003c")


def steps_to_json(steps: Sequence[FlightData], events: Sequence[Sequence[Event]], first: bool) -> str:
    """Return new samples and events of the vehicles of a live run for the browser; surfaces in the
    first step."""
    frames = max(LEAST, STEP_FRAMES // len(steps))
    tables = [_table(step, step.vehicle, _colour(i), frames, later=True) for i, step in enumerate(steps)]
    if not first:
        for body in (body for table in tables for body in table["bodies"]):
            body["surface"] = None
    told = [
        (event.time, step.vehicle, event.kind, event.text)
        for step, happened in zip(steps, events, strict=True)
        for event in happened
    ]
    given = {"end": float(steps[0].truth.times[-1]), "flights": tables, "events": sorted(told, key=lambda e: e[0])}
    return json.dumps(given, separators=(",", ":"))


def _colour(place: int) -> str:
    """Return the colour of the vehicle at this place of a fleet."""
    return COLOURS[place % len(COLOURS)]


def _table(flight: FlightData, name: str, colour: str, frames: int, later: bool = False) -> dict[str, Any]:
    """A flight in at most so many rows; `later`: wind and forces that are not there may come yet."""
    truth, moved = flight.truth, motion(flight)
    kept = np.unique(np.linspace(0, len(truth) - 1, min(frames, len(truth))).round().astype(int))
    times = truth.times[kept]
    followed = flight.reference[:, :3]
    asked = followed[np.minimum(kept, len(followed) - 1)] if len(followed) else None
    return {
        "name": name,
        "colour": colour,
        "t": _array(times, np.float64),
        "path": _array(truth.position[kept]),
        "asked": None if asked is None else _array(asked),
        "wind": _array(truth.wind[kept]) if later or np.any(truth.wind) else None,
        "bodies": [_body(body, times, kept, later) for body in moved.bodies],
        "contact": _contact(flight, times),
        "links": moved.links,
    }


def _body(body: Body, times: np.ndarray, kept: np.ndarray, later: bool) -> dict[str, Any]:
    rows = np.searchsorted(body.times, times - 1e-9).clip(max=len(body.times) - 1)
    force = body.force
    return {
        "name": body.name,
        "p": _array(np.column_stack([np.interp(times, body.times, along) for along in body.position.T])),
        "q": _array(body.orientation[rows]),
        "f": _array(force[rows]) if force is not None and (later or np.any(force)) else None,
        "surface": (s := body.surface) and [_array(s.vertices), _array(s.faces, np.uint16), s.colour],
        "strokes": [[_array(s.points), s.colour, s.width] for s in body.strokes],
        "rotors": [
            [_array(r.hub), r.radius, None if r.angle is None else _array(np.remainder(r.angle[kept], 2.0 * np.pi))]
            for r in body.rotors
        ],
    }


def _contact(flight: FlightData, times: np.ndarray) -> dict[str, Any] | None:
    """Points that may touch the ground, and the forces on them, point by point in each row; None where nobody tells."""
    if not flight.has("contact_forces"):
        return None
    told = flight.topic("contact_forces")
    rows = np.searchsorted(told.times, times - 1e-9).clip(max=len(told) - 1)
    return {"points": told.position.shape[1], "p": _array(told.position[rows]), "f": _array(told.force[rows])}


def _array(values: Any, kind: Any = np.float32) -> str:
    """Numbers row by row, little-endian, in base64."""
    return base64.b64encode(np.ascontiguousarray(values, np.dtype(kind).newbyteorder("<")).tobytes()).decode("ascii")
