"""The crate that unloads its pack: pack, door, rollers, walls and ground."""

import numpy as np

from lapwing.studies.flight_data import FlightData
from lapwing.studies.report.motion_3d import LEVEL, Body, Motion, Stroke, of_bodies
from lapwing.studies.report.shapes._outlines import box, circle
from lapwing.studies.report.style import BOUND, FLOWN, QUIET

MODELS = ("unloading",)


def draw(flight: FlightData) -> Motion | None:
    """The bodies of the log, with the floor and the walls of the crate, which stand."""
    if not flight.has("body_states"):
        return None
    crate, said = flight.origin.scene["unloading"], flight.topic("body_states")
    width, count = crate["width"], said.position.shape[1]
    door = np.array([(0.0, y * width / 2.0, z) for y, z in ((-1, 0), (1, 0), (1, 1), (-1, 1), (-1, 0))])
    door[:, 2] *= crate["door_length"]
    across = np.array((0.0, width / 2.0, 0.0))
    sides = [circle(crate["roller_radius"], 1) + side * across for side in (-1.0, 1.0)]
    roller = (tuple(Stroke(side, QUIET, 3.0) for side in sides), ())
    drawn = [
        ((Stroke(box(*crate["pack_size"]), FLOWN),), ()),
        ((Stroke(door, BOUND),), ()),
        *[roller] * (count - 3),
        ((), ()),
    ]
    return Motion((*of_bodies(flight, drawn), _crate(crate, said.times)))


def _crate(crate: dict, times: np.ndarray) -> Body:
    tilt, half = np.radians(crate["tilt_deg"]), crate["width"] / 2.0
    back = np.array((-np.cos(tilt), 0.0, np.sin(tilt))) * crate["depth"]
    up = np.array((np.sin(tilt), 0.0, np.cos(tilt))) * crate["door_length"]
    hinge = np.array((0.0, 0.0, crate["floor_height"]))
    across, corners = np.array((0.0, half, 0.0)), np.array([hinge, hinge + back, hinge + back + up])
    strokes = [Stroke(corners + side * across) for side in (-1.0, 1.0)]
    strokes += [Stroke(np.array([corner - across, corner + across])) for corner in corners]
    still = np.zeros((len(times), 3))
    return Body("crate", times, still, np.tile(LEVEL, (len(times), 1)), tuple(strokes))
