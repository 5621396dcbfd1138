"""Quadrotors with a common load: error of the load from its path, angles of the links, thrusts, and side view."""

from typing import Any

import numpy as np

from lapwing.flights.flight_data import FlightData
from lapwing.views.report.flight_phases import over
from lapwing.views.report.plot import Line, Panel, Plot, reference
from lapwing.views.report.style import BOUND, COLOURS

ORDER = 35
TITLE = "Load, links and quadrotors"
NEEDS = ("ground_truth", "body_states", "rotor_wrench")
MODELS = ("cooperative_load",)
INSTANTS = 11  # number of times at which the side view shows the links


def draw(flight: FlightData) -> Plot:
    """Plot three panels over time on the left, the side view on the right."""
    t = flight.times("body_states")
    position = flight.topic("body_states").position
    desired = _desired_path(flight, t)
    error = np.linalg.norm(position[:, 0] - desired, axis=1)
    links = position[:, :1] - position[:, 1:]
    angle = np.degrees(np.arctan2(links[..., 0], -links[..., 2]))
    thrust = flight.topic("rotor_wrench").thrust
    panels = (
        Panel((Line(t, np.where(error > 0.0, error, np.nan), colour=BOUND),), "load error [m]", log_y=True),
        Panel(_each(t, angle), "link from vertical [°]", row=1),
        Panel(_each(flight.times("rotor_wrench"), thrust), "thrust [N]", row=2),
        side_view(position, desired),
    )
    caption = (
        "Distance of the load from its path, the links' angles in the x-z plane and the thrusts; on the right the "
        f"side view at {INSTANTS} times. The final distance of the load from its path is {error[-1]:.2g} m."
    )
    return Plot(panels, caption, 7.2, (1.0,) * 3, (1.2, 1.0), **over(flight))


def side_view(position: np.ndarray, desired: np.ndarray) -> Panel:
    """Return the panel of the load's path and the links in the xz plane.

    Args:
        position: positions of the load and the quadrotors [m], shape (n, 1 + k, 3).
        desired: desired path of the load [m], shape (n, 3).
    """
    marks = [
        Line(position[:, 0, 0], position[:, 0, 2], "load", BOUND),
        reference(desired[:, 0], desired[:, 2], name="desired path"),
    ]
    sampled = position[np.linspace(0, len(position) - 1, INSTANTS).astype(int)]
    for i in range(position.shape[1] - 1):
        quad, colour = sampled[:, 1 + i], COLOURS[i % len(COLOURS)]
        gap = np.full(len(sampled), np.nan)
        x = np.column_stack([quad[:, 0], sampled[:, 0, 0], gap]).ravel()
        z = np.column_stack([quad[:, 2], sampled[:, 0, 2], gap]).ravel()
        marks.append(Line(x, z, colour=colour, width=0.7))
        marks.append(Line(quad[:, 0], quad[:, 2], f"quadrotor {i + 1}", colour, marker="square", joined=False))
    cell: dict[str, Any] = {"row": 0, "column": 1, "rows": 3}
    return Panel(tuple(marks), "z up [m]", "x [m]", timed=False, equal=True, **cell)


def _each(t: np.ndarray, values: np.ndarray) -> tuple[Line, ...]:
    """Return a line for each column of values, shape (n, quadrotors)."""
    return tuple(Line(t, column, f"quadrotor {i + 1}", COLOURS[i % len(COLOURS)]) for i, column in enumerate(values.T))


def _desired_path(flight: FlightData, t: np.ndarray) -> np.ndarray:
    """Return the load's desired path [m] at times t, shape (n, 3)."""
    path = np.array(flight.origin.scene["formation"]["path"])
    return path[0] + t[:, None] * path[1] + t[:, None] ** 2 * path[2]
