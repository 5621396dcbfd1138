"""Unloading of the pack: its displacements (the paper's Figure 28), door, forces, and side views."""

from typing import Any

import numpy as np

from lapwing.flights.flight_data import FlightData
from lapwing.views.report.flight_phases import over
from lapwing.views.report.plot import Line, Panel, Plot
from lapwing.views.report.style import AXIS_COLOURS, BOUND, REFERENCE

ORDER = 5
TITLE = "Unloading"
NEEDS = ("ground_truth", "body_states")
MODELS = ("unloading",)
INSTANTS = (0.0, 0.16, 0.24, 0.27, 0.3, 0.5)  # times of the side views, over twice the time of the pickup


def draw(flight: FlightData) -> Plot:
    """Plot displacements, door and forces over time, and the side view at six times."""
    crate = flight.origin.scene["unloading"]
    bodies = flight.topic("body_states")
    t, place = bodies.times, bodies.position
    turn = np.array([_pitch(q) for q in np.moveaxis(bodies.orientation[:, :2], 1, 0)]).T
    force = np.linalg.norm(bodies.force, axis=2)
    door = turn[:, 1] - crate["tilt_deg"]
    before = t <= crate["pickup"]
    rows = (("longitudinal [m]", place[:, 0, 0]), ("vertical [m]", place[:, 0, 2]), ("angular [°]", turn[:, 0]))
    panels = [
        Panel((Line(t[before], values[before]),), label, row=i, columns=2) for i, (label, values) in enumerate(rows)
    ]
    panels.append(Panel((Line(t, door, colour=BOUND),), "door [°]", row=0, column=2))
    forces = zip(
        (force[:, 2:6].sum(axis=1), force[:, 1], force[:, 6]), ("rollers", "door", "ground"), AXIS_COLOURS, strict=True
    )
    marks = tuple(Line(t, values, name, colour, 0.9) for values, name, colour in forces)
    panels.append(Panel(marks, "contact force [N]", row=1, column=2, rows=2))
    for i, part in enumerate(INSTANTS):
        k = int(np.searchsorted(t, part * crate["pickup"] * 2.0 if part < 0.5 else crate["pickup"] - 0.1))
        k = min(k, len(t) - 1)
        panels.append(side_view(crate, place[k], turn[k])._replace(title=f"{t[k]:.2f} s", row=3 + i // 3, column=i % 3))
    shut = t[before.sum() :][np.abs(door[before.sum() :]) < 1.0]
    note = f"the door closes {shut[0] - crate['pickup']:.2f} s after pickup" if len(shut) else "the door stays open"
    caption = (
        "Displacements of the pack's centre until pickup (longitudinal, vertical, angular as in the paper's "
        f"Figure 28), the door's angle from shut, the contact forces on the pack, and the crate from the side; {note}."
    )
    return Plot(tuple(panels), caption, 10.4, (1.0, 1.0, 1.0, 1.25, 1.25), (1.0,) * 3, **over(flight))


def side_view(crate: dict, place: np.ndarray, turn: np.ndarray) -> Panel:
    """Return the side view of crate and bodies at positions [m], (bodies, 3), and angles [deg], (bodies,)."""
    length, _, height = crate["pack_size"]
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]) * (length / 2, height / 2)
    pack = place[0, [0, 2]] + corners @ _matrix(turn[0]).T
    hinge = np.array((0.0, crate["floor_height"]))
    walls = np.array([(0, 0), (-crate["depth"], 0), (-crate["depth"], crate["door_length"])])
    frame = hinge + walls @ _matrix(crate["tilt_deg"]).T
    door = np.array([hinge, hinge + _matrix(turn[1]) @ np.array((0.0, crate["door_length"]))])
    circle = np.linspace(0, 2 * np.pi, 25)
    ring = crate["roller_radius"] * np.column_stack([np.cos(circle), np.sin(circle)])
    left, right = -0.27, 0.42
    ground = np.array([(left, 0.0), (right, 0.0)])
    rollers = tuple(
        _outline(roller[[0, 2]] + ring, colour=REFERENCE, width=0.7, fill="#BBBBBB") for roller in place[2:6]
    )
    marks = (
        _outline(pack, width=1.0, fill="#9CC3DD"),
        _outline(frame, colour=REFERENCE, width=1.5),
        *rollers,
        _outline(door, colour=BOUND, width=2.0),
        _outline(ground, colour=REFERENCE, width=1.0),
    )
    ranges: dict[str, Any] = {"x_range": (left, right), "y_range": (-0.03, 0.45)}
    return Panel(marks, "z [m]", "x [m]", timed=False, equal=True, **ranges)


def _outline(points: np.ndarray, **style: Any) -> Line:
    """Return a line through points (x, z), shape (n, 2)."""
    return Line(points[:, 0], points[:, 1], **style)


def _matrix(degrees: float) -> np.ndarray:
    """Return the matrix of the rotation of (x, z) about y by an angle [deg]."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([(c, s), (-s, c)])


def _pitch(xyzw: np.ndarray) -> np.ndarray:
    """Return the angles about y [deg], shape (n,), of quaternions of rotations about y only, shape (n, 4)."""
    from scipy.spatial.transform import Rotation  # imported on use: it takes 0.2 s

    return np.degrees(Rotation.from_quat(xyzw).as_rotvec()[:, 1])
