"""Moving bodies of a flight: poses over time, solids, rotors, and links and cables between bodies."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lapwing.flights.flight_data import FlightData
from lapwing.views.view3d.solids import Solid

LEVEL = (0.0, 0.0, 0.0, 1.0)  # x, y, z, w
PARTS = 12  # number of segments of a drawn cable


class Rotor(NamedTuple):
    """A propeller that spins about z of its body's frame."""

    hub: np.ndarray  # [m] position in the frame of the body, shape (3,)
    radius: float  # [m]
    angle: np.ndarray | None = None  # [rad] at the times of the truth, shape (n,); None: the body itself spins
    thrust: np.ndarray | None = None  # [N] at the times of the truth, shape (n,)


class Body(NamedTuple):
    """A rigid body."""

    name: str
    times: np.ndarray  # [s], shape (n,)
    position: np.ndarray  # world [m], shape (n, 3)
    orientation: np.ndarray  # body to world, x, y, z, w, shape (n, 4)
    solids: tuple[Solid, ...] = ()
    rotors: tuple[Rotor, ...] = ()
    force: np.ndarray | None = None  # force of contacts or joints, world [N], shape (n, 3)


class Link(NamedTuple):
    """A line between two bodies: a rigid link, or a cable, which sags while no force acts on the second body."""

    first: int  # index of the body
    second: int  # index of the body at whose origin the line ends
    hook: tuple[float, float, float] = (0.0, 0.0, 0.0)  # [m] start of the line, frame of the first body
    length: float = 0.0  # [m] unstretched length of a cable; 0 for a rigid link


class Motion(NamedTuple):
    """All bodies of a flight and their links."""

    bodies: tuple[Body, ...]
    links: tuple[Link, ...] = ()


def body_of_truth(flight: FlightData, solids: Sequence[Solid], rotors: Sequence[Rotor] = ()) -> Body:
    """Return the vehicle as one body."""
    truth = flight.truth
    return Body(flight.vehicle, truth.times, truth.position, truth.orientation, tuple(solids), tuple(rotors))


def recorded_bodies(flight: FlightData, shapes: Sequence[tuple[Sequence[Solid], Sequence[Rotor]]]) -> tuple[Body, ...]:
    """Return the bodies of the topic `body_states` in its order, with the solids and rotors of each in `shapes`."""
    states = flight.topic("body_states")
    names, position, orientation, force = states.name[0], states.position, states.orientation, states.force
    return tuple(
        Body(str(names[k]), states.times, position[:, k], orientation[:, k], tuple(solids), tuple(rotors), force[:, k])
        for k, (solids, rotors) in enumerate(shapes)
    )


def cable(start: np.ndarray, stop: np.ndarray, length: float) -> np.ndarray:
    """Return points from `start` to `stop` [m], shape (PARTS + 1, 3); they sag if `length` [m] exceeds the distance."""
    points = np.linspace(start, stop, PARTS + 1)
    if length > float(np.linalg.norm(stop - start)):
        points += _sag(start, stop, length)
    return points


def _sag(start: np.ndarray, stop: np.ndarray, length: float) -> np.ndarray:
    """Return the offsets of a slack cable from its chord [m], a parabola of about its length, shape (PARTS + 1, 3)."""
    chord = stop - start
    distance = float(np.linalg.norm(chord))
    depth = np.sqrt(3.0 * distance * (length - distance) / 8.0) if distance > 0.0 else length / 2.0
    down = np.array([0.0, 0.0, -1.0])
    across = down - chord * float(down @ chord) / max(distance * distance, 1e-9)
    size = float(np.linalg.norm(across))
    across = across / size if size > 1e-3 else np.array([1.0, 0.0, 0.0])  # a vertical chord bends to one side
    share = np.linspace(0.0, 1.0, PARTS + 1)
    return (depth * 4.0 * share * (1.0 - share))[:, None] * across
