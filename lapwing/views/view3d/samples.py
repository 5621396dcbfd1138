"""Poses, rotors, arrows and ghosts of a flight, sampled at k times."""

from typing import Any, NamedTuple

import numpy as np

from lapwing.flights.flight_data import FlightData
from lapwing.flights.rotation_arrays import from_euler, from_xyzw
from lapwing.messages.topics import RANGEFINDER, SONAR
from lapwing.views.view3d.bodies import Body, Motion
from lapwing.views.view3d.sampling import along, nearest, round_angle, round_to_grid
from lapwing.views.view3d.scans import Scans, scans
from lapwing.views.view3d.solids import ball, solid_of_revolution
from lapwing.views.view3d.surroundings import add_solid

TOPICS = {topic.name.removeprefix("{vehicle}/"): topic for topic in (SONAR, RANGEFINDER)}
COLOUR, POINT = "#E69F00", "#D55E00"
NARROWEST = np.radians(1.5)  # [rad] smallest half angle of a drawn beam
DOWN = -90.0  # [deg] default elevation of a beam


class BeamSamples(NamedTuple):
    """Readings of one distance sensor at k times."""

    name: str
    origin: tuple[float, float, float]  # [m] position of the sensor, body frame
    orientation: tuple[float, float, float, float]  # w, x, y, z: rotates z to the direction of the beam
    half_angle: float  # [rad]
    length: np.ndarray  # (k,) [m]; not finite without an echo


def beams(flight: FlightData, times: np.ndarray) -> list[BeamSamples]:
    """Return the beams of the distance sensors of a flight at `times` [s], shape (k,)."""
    sensors, result = flight.origin.scene.get("sensors", {}), []
    for name in TOPICS:
        if not flight.has(name) or not len(readings := flight.topic(name)):
            continue
        table = sensors.get(name, {})
        azimuth, elevation = (np.radians(table.get(f"{k}_deg", d)) for k, d in (("azimuth", 0.0), ("elevation", DOWN)))
        level = float(np.cos(elevation))
        direction = np.array([[level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)]])
        half = max(NARROWEST, 0.5 * float(readings.field_of_view[0]))
        length = readings.range[nearest(readings.times, times)].astype(float)
        x, y, z = table.get("position", (0.0, 0.0, 0.0))  # relative to the centre of mass, as in the simulation
        result.append(BeamSamples(name, (x, y, z), tuple(along(direction)[0].tolist()), half, length))
    return result


class Beam:
    """Nodes of a beam below the node of its body."""

    def __init__(self, scene: Any, body: str, samples: BeamSamples, size: float):
        """Add the nodes; `size` is the size of the vehicle [m], which scales the point."""
        self._width_ratio, self._length = float(np.tan(samples.half_angle)), 0.0
        frame = f"{body}/{samples.name}"
        scene.add_frame(frame, show_axes=False, position=samples.origin, wxyz=samples.orientation)
        cone = solid_of_revolution([(0.0, 0.0), (1.0, 1.0)], COLOUR, 0.22)._replace(open=True)
        self._cone = add_solid(scene, f"{frame}/cone", cone, visible=False)
        self._point = add_solid(scene, f"{frame}/point", ball((0.0,) * 3, 0.035 * size, POINT), visible=False)

    def show(self, samples: BeamSamples, k: int) -> None:
        """Show the k-th reading, rounded to 1 cm; hide the beam without an echo."""
        length = float(samples.length[k])
        length = round(length, 2) if np.isfinite(length) and length > 0.0 else 0.0
        if length == self._length:
            return
        for node in (self._cone, self._point):
            if (length > 0.0) != (self._length > 0.0):
                node.visible = length > 0.0
        self._length = length
        if length > 0.0:
            self._cone.scale = (length * self._width_ratio, length * self._width_ratio, length)
            self._point.position = (0.0, 0.0, length)


class BodySamples(NamedTuple):
    """Samples of one body at k times."""

    position: np.ndarray  # (k, 3) [m] world
    orientation: np.ndarray  # (k, 4) w, x, y, z
    angles: np.ndarray | None  # (k, rotors) [rad] in the frame of the body
    thrusts: np.ndarray | None  # (k, rotors) [N]
    force: np.ndarray | None  # (k, 3) [N] world


class Samples(NamedTuple):
    """Samples of one vehicle at k times."""

    times: np.ndarray  # (k,) [s]
    bodies: list[BodySamples]
    wind: np.ndarray | None  # (k, 3) [m/s] world
    desired: np.ndarray | None  # (k, 3) [m]
    desired_attitude: np.ndarray | None  # (k, 4) w, x, y, z
    estimate: np.ndarray | None  # (k, 3) [m]
    estimate_attitude: np.ndarray | None  # (k, 4) w, x, y, z
    estimate_std: np.ndarray | None  # (k, 3) [m]
    contacts: np.ndarray | None  # (k, points, 3) [m] world
    contact_forces: np.ndarray | None  # (k, points, 3) [N] world
    error: np.ndarray | None  # (k,) [m] distance from the reference
    beams: list[BeamSamples]
    scans: list[Scans]


def sample(flight: FlightData, motion: Motion, times: np.ndarray, points: int = 0) -> Samples:
    """Return the data of the 3D view of a flight at `times` [s], shape (k,), ascending.

    `points` limits the total number of points of a scanning instrument; 0 omits scans.
    """
    truth = flight.truth
    rows = nearest(truth.times, times)
    path = truth.position[rows]
    wind = truth.wind[rows] if "wind" in truth.fields and np.any(truth.wind) else None
    desired = attitude = error = None
    if len(flight.reference):
        last = np.minimum(rows, len(flight.reference) - 1)
        desired, attitude = flight.reference[last, :3], round_to_grid(from_euler(flight.reference[last, 3:]))
        error = np.linalg.norm(path - desired, axis=1)
    estimate = estimate_attitude = std = None
    if flight.has("estimate"):
        view = flight.topic("estimate")
        own = nearest(view.times, times)
        estimate, std = view.position[own], view.position_std[own]
        estimate_attitude = round_to_grid(from_xyzw(view.orientation[own]))
    contacts = forces = None
    if flight.has("contact_forces"):
        view = flight.topic("contact_forces")
        own = nearest(view.times, times)
        contacts, forces = view.position[own], view.force[own]
    bodies = [_body(body, times, rows) for body in motion.bodies]
    distances, clouds = beams(flight, times), scans(flight, times, points) if points else []
    return Samples(
        times, bodies, wind, desired, attitude, estimate, estimate_attitude, std, contacts, forces, error, distances,
        clouds,
    )  # fmt: skip


def _body(body: Body, times: np.ndarray, rows: np.ndarray) -> BodySamples:
    own = nearest(body.times, times)
    position = np.column_stack([np.interp(times, body.times, values) for values in body.position.T])
    angles = _columns([rotor.angle for rotor in body.rotors], rows)
    thrusts = _columns([rotor.thrust for rotor in body.rotors], rows)
    angles = None if angles is None else round_angle(angles)
    force = body.force[own] if body.force is not None and np.any(body.force) else None
    return BodySamples(round_to_grid(position), round_to_grid(from_xyzw(body.orientation[own])), angles, thrusts, force)


def _columns(values: list[np.ndarray | None], rows: np.ndarray) -> np.ndarray | None:
    """Return rows of values side by side, shape (k, columns), or None if one is missing or the list is empty."""
    columns = [value[rows] for value in values if value is not None]
    return np.column_stack(columns) if columns and len(columns) == len(values) else None
