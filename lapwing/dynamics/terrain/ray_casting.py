"""Exact intersections of rays with the ground and its obstacles, for many rays (theory, eq. (3.52))."""

import numpy as np

from lapwing.dynamics.terrain.heightfield import Relief, field
from lapwing.dynamics.terrain.terrain_queries import Level
from lapwing.kernels import kernel, math

FINEST = 0.02  # [m] smallest step of a march over bumps or a grid
HALVINGS = 24  # number of bisections, from the step to below 1 um


def as_relief(terrain: Level | Relief) -> Relief:
    """Return the terrain as a `Relief`, level ground too, so that scans compile once."""
    if isinstance(terrain, Relief):
        return terrain
    none = (np.zeros((0, 0)), np.zeros((0, 7)), np.zeros((0, 4)))
    return Relief((0.0, 0.0), 0.0, 1.0, 0.0, none[0], (0.0, 0.0), 1.0, 0.0, none[1], none[2], 0.0)


def steepness(terrain: Relief) -> float:
    """Return a bound of the slope [m/m] of the ground without obstacles, so that a march misses nothing."""
    steep = math.hypot(*terrain.slope) + abs(terrain.bump_height) * terrain.bump_wavenumber * math.sqrt(2.0)
    return steep + terrain.grid_slope


@kernel
def _to_plane(t, o, d):
    a, b = t.slope
    gap = o[2] - (t.base + a * o[0] + b * o[1])
    if gap <= 0.0:
        return 0.0
    approach = a * d[0] + b * d[1] - d[2]
    return gap / approach if approach > 0.0 else math.inf


@kernel
def _to_field(t, o, d, steep, longest):
    """Return the distance to bumps or a grid by a march with the bound of the slope, and bisection."""
    before, after = 0.0, 0.0
    closing = steep * math.sqrt(d[0] * d[0] + d[1] * d[1]) - d[2]  # largest decrease of the gap per distance
    while True:
        gap = o[2] + after * d[2] - field(t, o[0] + after * d[0], o[1] + after * d[1])[0]
        if gap <= 0.0:
            break
        if after > longest or closing <= 0.0:
            return math.inf
        before, after = after, after + max(FINEST, gap / closing)
    for _ in range(HALVINGS):
        middle = 0.5 * (before + after)
        if o[2] + middle * d[2] > field(t, o[0] + middle * d[0], o[1] + middle * d[1])[0]:
            before = middle
        else:
            after = middle
    return after


@kernel
def between(position, direction, low, high, first, last):
    """Return the part of [first, last] in which a coordinate is between `low` and `high`."""
    if direction == 0.0:
        return (first, last) if low <= position <= high else (math.inf, -math.inf)
    one, two = (low - position) / direction, (high - position) / direction
    return max(first, min(one, two)), min(last, max(one, two))


@kernel
def _below(height, o, d, first, last):
    """Return the part of [first, last] in which the ray is not above a height."""
    if d[2] == 0.0:
        return (first, last) if o[2] <= height else (math.inf, -math.inf)
    crossing = (height - o[2]) / d[2]
    return (max(first, crossing), last) if d[2] < 0.0 else (first, min(last, crossing))


@kernel
def _to_box(box, o, d):
    x, y, c, s = o[0] - box[0], o[1] - box[1], box[2], box[3]
    first, last = _below(box[7], o, d, 0.0, math.inf)
    first, last = between(c * x + s * y, c * d[0] + s * d[1], box[4], box[5], first, last)
    first, last = between(c * y - s * x, c * d[1] - s * d[0], -box[6], box[6], first, last)
    return first if first <= last else math.inf


@kernel
def within_circle(x, y, d, radius):
    """Return the part (first, last) of the ray ahead of its origin that is within a circle about z, seen from above.

    `x` and `y` are those of the origin from the centre; first > last without such a part.
    """
    a, b = d[0] * d[0] + d[1] * d[1], x * d[0] + y * d[1]
    outside = x * x + y * y - radius * radius
    if a == 0.0:
        return (math.inf, -math.inf) if outside > 0.0 else (0.0, math.inf)
    square = b * b - a * outside
    if square < 0.0:
        return math.inf, -math.inf
    root = math.sqrt(square)
    return max((-b - root) / a, 0.0), (root - b) / a


@kernel
def _to_cylinder(cylinder, o, d):
    first, last = within_circle(o[0] - cylinder[0], o[1] - cylinder[1], d, cylinder[2])
    first, last = _below(cylinder[3], o, d, first, last)
    return first if first <= last else math.inf


@kernel
def cast(t, origin, direction, steep, longest):
    """Return the distance [m] along a unit vector to the ground or an obstacle; inf beyond `longest`, 0 from within.

    `steep` is `steepness` of the terrain.
    """
    result = math.inf
    for i in range(t.boxes.shape[0]):
        result = min(result, _to_box(t.boxes[i], origin, direction))
    for i in range(t.cylinders.shape[0]):
        result = min(result, _to_cylinder(t.cylinders[i], origin, direction))
    if t.bump_height == 0.0 and t.grid.size == 0:
        result = min(result, _to_plane(t, origin, direction))
    else:
        result = min(result, _to_field(t, origin, direction, steep, min(result, longest)))
    return result if result <= longest else math.inf
