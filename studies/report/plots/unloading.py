"""The unloading of the pack: its displacements (the paper's Figure 28), the door, the forces, and how it looks."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

from studies.flight import Flight
from studies.report.style import AXIS_COLOURS, BOUND, FLOWN, REFERENCE, WIDTH

ORDER = 5
TITLE = "Unloading"
NEEDS = ("truth", "bodies")
MODELS = ("unloading",)
INSTANTS = (0.0, 0.16, 0.24, 0.27, 0.3, 0.5)  # pictures, as parts of the time until the pack is taken


def draw(flight: Flight) -> tuple[Figure, str]:
    """The three displacements, door and forces over time, and six instants from the side."""
    crate = flight.origin.scene["unloading"]
    bodies = flight.topic("bodies")
    t, place = bodies.times, bodies.position
    turn = np.array([_pitch(q) for q in np.moveaxis(bodies.orientation[:, :2], 1, 0)]).T
    force = np.linalg.norm(bodies.force, axis=2)
    door = turn[:, 1] - crate["tilt_deg"]
    until = t <= crate["pickup"]
    figure = Figure(figsize=(WIDTH, 8.6), layout="constrained")
    grid = figure.add_gridspec(5, 3, height_ratios=(1, 1, 1, 1.25, 1.25))
    rows = (("longitudinal [m]", place[:, 0, 0]), ("vertical [m]", place[:, 0, 2]), ("angular [°]", turn[:, 0]))
    for i, (label, values) in enumerate(rows):
        axis = figure.add_subplot(grid[i, :2])
        axis.plot(t[until], values[until], color=FLOWN)
        axis.set_ylabel(label)
        axis.margins(x=0.0)
    axis.set_xlabel("time [s]")
    axis = figure.add_subplot(grid[0, 2])
    axis.plot(t, door, color=BOUND)
    axis.set(ylabel="door [°]")
    axis = figure.add_subplot(grid[1:3, 2])
    for values, name, colour in zip(
        (force[:, 2:6].sum(axis=1), force[:, 1], force[:, 6]), ("rollers", "door", "ground"), AXIS_COLOURS, strict=True
    ):
        axis.plot(t, values, color=colour, label=name, linewidth=0.9)
    axis.set(ylabel="contact force [N]", xlabel="time [s]", ylim=(0.0, 1.5 * force.max()))
    axis.set_yscale("symlog", linthresh=10.0)
    axis.legend(loc="upper right")
    for i, part in enumerate(INSTANTS):
        k = int(np.searchsorted(t, part * crate["pickup"] * 2.0 if part < 0.5 else crate["pickup"] - 0.1))
        k = min(k, len(t) - 1)
        axis = figure.add_subplot(grid[3 + i // 3, i % 3])
        picture(axis, crate, place[k], turn[k])
        axis.set_title(f"{t[k]:.2f} s", fontsize=9)
    shut = t[until.sum() :][np.abs(door[until.sum() :]) < 1.0]
    after = f"{shut[0] - crate['pickup']:.2f} s after it is taken the door is shut" if len(shut) else "it stays open"
    return figure, (
        "Displacements of the pack's middle until it is taken (longitudinal, vertical, angular as in the paper's "
        f"Figure 28), the door's angle from shut, the contact forces on the pack, and the crate from the side; {after}."
    )


def picture(axis: Axes, crate: dict, place: np.ndarray, turn: np.ndarray) -> None:
    """Crate, rollers, door and pack from the side."""
    length, _, height = crate["pack_size"]
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]) * (length / 2, height / 2)
    axis.fill(*(place[0, [0, 2]] + corners @ _matrix(turn[0]).T).T, color="#9CC3DD", edgecolor=FLOWN)
    frame = _matrix(crate["tilt_deg"])
    hinge = np.array((0.0, crate["floor_height"]))
    walls = np.array([(0, 0), (-crate["depth"], 0), (-crate["depth"], crate["door_length"])])
    axis.plot(*(hinge + walls @ frame.T).T, color=REFERENCE, linewidth=1.5)
    for roller in place[2:6]:
        circle = np.linspace(0, 2 * np.pi, 25)
        ring = crate["roller_radius"] * np.column_stack([np.cos(circle), np.sin(circle)])
        axis.fill(*(roller[[0, 2]] + ring).T, color="#BBBBBB", edgecolor=REFERENCE, linewidth=0.7)
    door = _matrix(turn[1]) @ np.array((0.0, crate["door_length"]))
    axis.plot(*np.column_stack([hinge, hinge + door]), color=BOUND, linewidth=2.0)
    axis.axhline(0.0, color=REFERENCE, linewidth=1.0)
    axis.set_aspect("equal", adjustable="box")
    axis.set(xlim=(-0.27, 0.42), ylim=(-0.03, 0.45))
    axis.tick_params(labelsize=7)


def _matrix(degrees: float) -> np.ndarray:
    """Turns (x, z) about y."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([(c, s), (-s, c)])


def _pitch(xyzw: np.ndarray) -> np.ndarray:
    """Angle about y [degrees] of attitudes that only turn about y, nearly."""
    return np.degrees(Rotation.from_quat(xyzw).as_rotvec()[:, 1])
