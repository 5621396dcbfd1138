"""Poses, rotors, arrows and ghosts of a flight, sampled at k times."""

from typing import NamedTuple

import numpy as np

from lapwing.studies.flight_data import FlightData
from lapwing.studies.rotation_arrays import from_euler
from lapwing.studies.view3d.beams import BeamSamples, beams
from lapwing.studies.view3d.bodies import Body, Motion
from lapwing.studies.view3d.sampling import nearest, round_angle, round_to_grid
from lapwing.studies.view3d.scans import Scans, scans


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
        estimate_attitude = round_to_grid(view.orientation[own][:, [3, 0, 1, 2]])
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
    return BodySamples(
        round_to_grid(position), round_to_grid(body.orientation[own][:, [3, 0, 1, 2]]), angles, thrusts, force
    )


def _columns(values: list[np.ndarray | None], rows: np.ndarray) -> np.ndarray | None:
    """Return rows of values side by side, shape (k, columns), or None if one is missing or the list is empty."""
    columns = [value[rows] for value in values if value is not None]
    return np.column_stack(columns) if columns and len(columns) == len(values) else None
