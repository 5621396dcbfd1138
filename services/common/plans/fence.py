"""Geofence of inclusion and exclusion polygons and circles; rally points."""

from collections.abc import Sequence
from typing import Any

from lapwing.kernels import math

OUTSIDE, INSIDE = "outside of the geofence", "in a keep-out area of the geofence"  # places that a fence forbids
_POLYGONS, _CIRCLES = ("fence_inclusion", "fence_exclusion"), ("fence_circle_in", "fence_circle_out")


def _inside(x: float, y: float, corners: Sequence[tuple[float, float]]) -> bool:
    """Return True if a point is inside a polygon, by the even-odd rule."""
    odd = False
    for (x0, y0), (x1, y1) in zip(corners, [*corners[1:], corners[0]], strict=True):
        if (y0 > y) != (y1 > y) and x < x0 + (y - y0) / (y1 - y0) * (x1 - x0):
            odd = not odd
    return odd


class Fence:
    """The uploaded geofence."""

    def __init__(self, items: Sequence[Any] = ()):
        """Create the fence from items: one per circle, and one per vertex of a polygon.

        Raises:
            ValueError: an item is invalid.
        """
        self.count = len(items)
        self.shapes: list[tuple[bool, Any]] = []  # True for inclusion; (x, y, radius) or corners
        remaining = list(items)
        while remaining:
            first = remaining[0]
            count = 1
            if first.action in _POLYGONS:
                count = int(first.values[0]) if first.values else 0
                if count < 3 or len(remaining) < count or any(i.action != first.action for i in remaining[:count]):
                    raise ValueError(f"fence: expected a polygon of {count} (at least 3) vertices in a row")
                shape: Any = [(i.position.x, i.position.y) for i in remaining[:count]]
            elif first.action in _CIRCLES:
                if not first.radius > 0.0:
                    raise ValueError(f"fence: expected a circle of a radius above 0 m, got {first.radius:g}")
                shape = (first.position.x, first.position.y, first.radius)
            else:
                raise ValueError(
                    f"fence: unknown action {first.action}; expected one of {', '.join(_POLYGONS + _CIRCLES)}"
                )
            if not all(map(math.isfinite, [p for i in remaining[:count] for p in (i.position.x, i.position.y)])):
                raise ValueError("fence: a position is not finite")
            self.shapes.append((first.action in ("fence_inclusion", "fence_circle_in"), shape))
            del remaining[:count]

    def allows(self, x: float, y: float) -> bool:
        """Return True if the vehicle may be at world (x, y) [m]."""
        return not self.breach(x, y)

    def breach(self, x: float, y: float) -> str:
        """Return OUTSIDE or INSIDE by the first area that forbids world (x, y) [m], "" if the vehicle may be there."""
        for stay_in, shape in self.shapes:
            if isinstance(shape, tuple):
                within = math.hypot(x - shape[0], y - shape[1]) <= shape[2]
            else:
                within = _inside(x, y, shape)
            if within != stay_in:
                return OUTSIDE if stay_in else INSIDE
        return ""


def rally_points(items: Sequence[Any]) -> tuple[tuple[float, float, float], ...]:
    """Return the rally points [m] of uploaded items. Raise ValueError if an item is invalid."""
    points = tuple((i.position.x, i.position.y, i.position.z) for i in items)
    if not all(math.isfinite(v) for point in points for v in point) or any(i.action != "rally" for i in items):
        raise ValueError("rally: expected points of the action rally at finite positions")
    return points
