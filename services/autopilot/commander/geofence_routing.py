"""Shortest path within the geofence, over the corners of its shapes (A*)."""

import heapq
from collections.abc import Iterator, Sequence

from lapwing.kernels import math
from lapwing.services.autopilot.commander.fence import Fence

MARGIN = 2.0  # [m] kept from the fence
CIRCLE_CORNERS = 12  # of the polygon around a circle
MOST_CORNERS = 200  # a fence with more is not routed around

Point = tuple[float, float]


def route_around(fence: Fence, start: Point, goal: Point) -> list[Point]:
    """Return the corners [m] of the path to the goal, including it; the straight path if there is no other."""
    if _free(fence, start, goal) or not fence.allows(*start) or not fence.allows(*goal):
        return [goal]
    corners = [corner for corner in _corners(fence) if fence.allows(*corner)]
    points = [start, *corners, goal]
    last = len(points) - 1
    if len(corners) > MOST_CORNERS:
        return [goal]
    length, before, done = {0: 0.0}, {0: 0}, set()
    queue = [(math.dist(start, goal), 0)]
    while queue:
        _, here = heapq.heappop(queue)
        if here == last:
            return _unwound(points, before, last)
        if here in done:
            continue
        done.add(here)
        for there, point in enumerate(points):
            beyond = length[here] + math.dist(points[here], point)
            if there not in done and beyond < length.get(there, math.inf) and _free(fence, points[here], point):
                length[there], before[there] = beyond, here
                heapq.heappush(queue, (beyond + math.dist(point, goal), there))
    return [goal]


def _unwound(points: Sequence[Point], before: dict[int, int], last: int) -> list[Point]:
    way = []
    while last:
        way.append(points[last])
        last = before[last]
    return way[::-1]


def _corners(fence: Fence) -> Iterator[Point]:
    """Yield points on both sides of every polygon corner and around every exclusion circle."""
    for stay_in, shape in fence.shapes:
        if isinstance(shape, list):
            for k, (x, y) in enumerate(shape):
                dx, dy = _bisector(shape[k - 1], (x, y), shape[(k + 1) % len(shape)])
                yield x + MARGIN * dx, y + MARGIN * dy
                yield x - MARGIN * dx, y - MARGIN * dy
        elif not stay_in:
            x, y, radius = shape
            far = (radius + MARGIN) / math.cos(math.pi / CIRCLE_CORNERS)
            for k in range(CIRCLE_CORNERS):
                angle = 2.0 * math.pi * k / CIRCLE_CORNERS
                yield x + far * math.cos(angle), y + far * math.sin(angle)


def _bisector(before: Point, corner: Point, after: Point) -> Point:
    """Return the unit bisector of a corner."""
    (ax, ay), (bx, by) = _unit(before, corner), _unit(after, corner)
    x, y = ax + bx, ay + by
    length = math.hypot(x, y)
    return (x / length, y / length) if length > 1e-9 else (-ay, ax)


def _unit(start: Point, end: Point) -> Point:
    length = math.dist(start, end) or 1.0
    return (end[0] - start[0]) / length, (end[1] - start[1]) / length


def _free(fence: Fence, a: Point, b: Point) -> bool:
    """Return True if the straight path between two points respects the fence."""
    middle = 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])
    if not fence.allows(*middle):
        return False
    for stay_in, shape in fence.shapes:
        if isinstance(shape, list):
            if any(_cross(a, b, c, d) for c, d in zip(shape, [*shape[1:], shape[0]], strict=True)):
                return False
        elif not stay_in and _distance(shape[:2], a, b) <= shape[2]:
            return False
    return True


def _side(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _cross(a: Point, b: Point, c: Point, d: Point) -> bool:
    return _side(a, b, c) * _side(a, b, d) <= 0.0 and _side(c, d, a) * _side(c, d, b) <= 0.0


def _distance(point: Point, a: Point, b: Point) -> float:
    """Return the distance of a point from a line segment."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    square = dx * dx + dy * dy
    share = ((point[0] - a[0]) * dx + (point[1] - a[1]) * dy) / square if square > 0.0 else 0.0
    share = max(0.0, min(1.0, share))
    return math.hypot(a[0] + share * dx - point[0], a[1] + share * dy - point[1])
