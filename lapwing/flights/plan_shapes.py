"""Waypoints and fence of the flight plan of a flight, for maps and the 3D view."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from lapwing.flights.flight_data import FlightData
from lapwing.flights.mission import last_upload
from lapwing.services.common.plans.fence import Fence

ACTIONS = ("waypoint", "loiter_time", "orbit", "land", "takeoff")  # items with a position


class FenceShape(NamedTuple):
    """Outline of a fence area."""

    stay_in: bool  # False: the vehicle must stay out
    corners: np.ndarray  # [m] world x and y, shape (k, 2), not closed


def waypoints(flight: FlightData) -> np.ndarray:
    """Return the positions of the plan's mission items in order [m], world, shape (n, 3)."""
    items = _uploads(flight, "mission_upload")
    positions = [(i.position.x, i.position.y, i.position.z) for i in items if i.action in ACTIONS]
    points = np.array(positions, float).reshape(-1, 3)
    return points[np.isfinite(points).all(axis=1)]


def fence_shapes(flight: FlightData) -> Iterator[FenceShape]:
    """Yield the areas of the plan's fence, circles as polygons; nothing if the fence is invalid."""
    try:
        shapes = Fence(_uploads(flight, "fence_upload")).shapes
    except ValueError:
        return
    for stay_in, shape in shapes:
        if isinstance(shape, tuple):
            angle = np.linspace(0.0, 2.0 * np.pi, 49)[:-1]
            corners = np.array(shape[:2]) + shape[2] * np.column_stack([np.cos(angle), np.sin(angle)])
        else:
            corners = np.array(shape, float)
        yield FenceShape(stay_in, corners)


def _uploads(flight: FlightData, kind: str) -> tuple[Any, ...]:
    """Return the items of the last upload of a kind in the flight's plan; empty without one."""
    try:
        return last_upload(flight.config.services["autopilot"].parameters, kind)
    except (KeyError, ValueError):
        return ()
