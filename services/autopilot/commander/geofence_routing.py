"""Shortest path within the geofence, over the corners of its shapes (A*)."""

import heapq
from collections.abc import Iterator, Sequence

from lapwing.kernels import math
from lapwing.services.common.plans.fence import Fence

MARGIN = 2.0  # [m] clearance from the fence
CIRCLE_CORNERS = 12  # vertices of the polygon around a circle
MOST_CORNERS = 200  # above which the path is straight

Point = tuple[float, float]


def route_around(fence: Fence, start: Point, goal: Point) -> list[Point]:
    """Return the corners [m] of the path to the goal, including it; the straight path if there is no other."""
    if _is_clear(fence, start, goal) or not fence.allows(*start) or not fence.allows(*goal):
        return [goal]
    corners = [corner for corner in _corners(fence) if fence.allows(*corner)]
    points = [start, *corners, goal]
    last = len(points) - 1
    if len(corners) > MOST_CORNERS:
        return [goal]
    length, previous, visited = {0: 0.0}, {0: 0}, set()
    queue = [(math.dist(start, goal), 0)]
    while queue:
        _, node = heapq.heappop(queue)
        if node == last:
            return _path(points, previous, last)
        if node in visited:
            continue
        visited.add(node)
        for neighbour, point in enumerate(points):
            total = length[node] + math.dist(points[node], point)
            if (
                neighbour not in visited
                and total < length.get(neighbour, math.inf)
                and _is_clear(fence, points[node], point)
            ):
                length[neighbour], previous[neighbour] = total, node
                heapq.heappush(queue, (total + math.dist(point, goal), neighbour))
    return [goal]


def _path(points: Sequence[Point], previous: dict[int, int], last: int) -> list[Point]:
    """Return the points from after the start to `last`."""
    path = []
    while last:
        path.append(points[last])
        last = previous[last]
    return path[::-1]


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
            distance = (radius + MARGIN) / math.cos(math.pi / CIRCLE_CORNERS)
            for k in range(CIRCLE_CORNERS):
                angle = 2.0 * math.pi * k / CIRCLE_CORNERS
                yield x + distance * math.cos(angle), y + distance * math.sin(angle)


def _bisector(before: Point, corner: Point, after: Point) -> Point:
    """Return the unit bisector of a corner."""
    (ax, ay), (bx, by) = _unit(before, corner), _unit(after, corner)
    x, y = ax + bx, ay + by
    length = math.hypot(x, y)
    return (x / length, y / length) if length > 1e-9 else (-ay, ax)


def _unit(start: Point, end: Point) -> Point:
    length = math.dist(start, end) or 1.0
    return (end[0] - start[0]) / length, (end[1] - start[1]) / length


def _is_clear(fence: Fence, a: Point, b: Point) -> bool:
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
