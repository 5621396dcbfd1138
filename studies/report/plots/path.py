"""The path in space, and seen from above."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.axes3d import Axes3D

from studies.flight import Flight
from studies.report.style import DASHED, FLOWN, POINTS, WIDTH

ORDER = 40
TITLE = "Path"
NEEDS = ("truth",)


def draw(flight: Flight) -> tuple[Figure, str]:
    """The path in 3D on the left, its plan view on the right."""
    figure = Figure(figsize=(WIDTH, 4.9), layout="constrained")
    space(figure.add_subplot(1, 2, 1, projection="3d"), flight)
    plan(figure.add_subplot(1, 2, 2), flight)
    return figure, "The flown path beside the reference, in space (left) and from above, north up (right)."


def space(axes: Axes3D, flight: Flight) -> None:
    """Draw into a 3D plot; the three axes have one scale."""
    reference, position = _paths(flight)
    axes.plot(*position.T, color=FLOWN, linewidth=2.0, label="flown")
    if len(reference):
        axes.plot(*reference.T, label="reference", **DASHED)
    low, high = position.min(axis=0), position.max(axis=0)
    half = 0.55 * max((high - low).max(), 0.5)
    middle = 0.5 * (low + high)
    axes.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half))
    floor = min(low[2], 0.0)
    axes.set_zlim(floor, floor + 2 * half)
    axes.set_box_aspect((1, 1, 1), zoom=0.88)
    axes.set(xlabel="x east [m]", ylabel="y north [m]")
    axes.zaxis.set_rotate_label(False)  # it would stand on its head
    axes.set_zlabel("z up [m]", rotation=90)
    axes.view_init(elev=24, azim=-128)
    axes.legend(loc="upper left")


def plan(axes: Axes, flight: Flight) -> None:
    """Draw what is seen from above."""
    reference, position = _paths(flight)
    axes.plot(*position[:, :2].T, color=FLOWN, linewidth=2.0, label="flown")
    if len(reference):
        axes.plot(*reference[:, :2].T, label="reference", **DASHED)
    ends: dict[str, Any] = {"color": FLOWN, "markersize": 7, "linestyle": "none"}
    axes.plot(*position[0, :2], marker="o", markerfacecolor="white", label="start", **ends)
    axes.plot(*position[-1, :2], marker="s", label="end", **ends)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.12)
    axes.set(xlabel="x east [m]", ylabel="y north [m]")
    axes.legend(loc="best")


def _paths(flight: Flight) -> tuple[np.ndarray, np.ndarray]:
    """Reference and flown positions [m], world frame, shapes (m, 3) and (n, 3), thinned for drawing."""
    position = flight.truth.position
    every = max(1, len(position) // POINTS)
    return flight.reference[::every, :3], position[::every]
