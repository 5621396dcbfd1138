"""Relief: a height over each point of the horizontal plane, and obstacles with level tops."""

from typing import NamedTuple

import numpy as np

from lapwing.kernels import kernel, math

UP = (-0.0, -0.0, 1.0)  # normal of level ground


class Relief(NamedTuple):
    """Ground that is not level."""

    slope: tuple[float, float]  # slope of the plane along world x and y
    bump_height: float  # [m] A of bumps A sin(k x) sin(k y)
    bump_wavenumber: float  # [rad/m] k
    base: float  # [m] height at home without bumps and grid
    grid: np.ndarray  # (rows along y, columns along x) heights [m]; (0, 0): none
    corner: tuple[float, float]  # [m] world x and y of grid[0, 0]
    spacing: float  # [m] spacing of the grid
    boxes: np.ndarray  # (n, 8) x, y of a point, cosine, sine of the heading, ends along it, half width, z of the top
    cylinders: np.ndarray  # (n, 4) x, y of the axis, radius, z of the top
    summit: float  # [m] largest height of the terrain above the plane through the origin with that slope


@kernel
def _between(t, x, y):
    """Return (height, slope along x, slope along y) of the grid, bilinear, with constant extrapolation."""
    rows, columns = t.grid.shape
    u, v = (x - t.corner[0]) / t.spacing, (y - t.corner[1]) / t.spacing
    inside_x, inside_y = 0.0 <= u <= columns - 1.0, 0.0 <= v <= rows - 1.0
    u, v = min(max(0.0, u), columns - 1.0), min(max(0.0, v), rows - 1.0)  # this order of arguments maps NaN to 0
    i, j = min(int(v), rows - 2), min(int(u), columns - 2)
    q, p = v - i, u - j
    a, b, c, d = t.grid[i, j], t.grid[i, j + 1], t.grid[i + 1, j], t.grid[i + 1, j + 1]
    height = (1.0 - q) * ((1.0 - p) * a + p * b) + q * ((1.0 - p) * c + p * d)
    rise_x = ((1.0 - q) * (b - a) + q * (d - c)) / t.spacing if inside_x else 0.0
    rise_y = ((1.0 - p) * (c - a) + p * (d - b)) / t.spacing if inside_y else 0.0
    return height, rise_x, rise_y


@kernel
def field(t, x, y):
    """Return (height [m], slope along x, slope along y) of the ground without obstacles."""
    a, b = t.slope
    height = t.base + a * x + b * y
    if t.bump_height != 0.0:
        h, k = t.bump_height, t.bump_wavenumber
        sx, cx = math.sincos(k * x)
        sy, cy = math.sincos(k * y)
        height, a, b = height + h * sx * sy, a + h * k * cx * sy, b + h * k * sx * cy
    if t.grid.size > 0:
        more, rise_x, rise_y = _between(t, x, y)
        height, a, b = height + more, a + rise_x, b + rise_y
    return height, a, b


@kernel
def _normal(a, b):
    steep = 1.0 / math.sqrt(1.0 + a * a + b * b)
    return (-a * steep, -b * steep, steep)


@kernel
def _in_box(box, x, y):
    """Return (distance [m] to the nearest side, negative outside; x and y of that side's normal)."""
    dx, dy, c, s = x - box[0], y - box[1], box[2], box[3]
    u, v = c * dx + s * dy, c * dy - s * dx
    behind, ahead, across = u - box[4], box[5] - u, box[6] - abs(v)
    along = min(behind, ahead)
    if along < across:
        sign = 1.0 if ahead <= behind else -1.0
        return along, sign * c, sign * s
    sign = math.copysign(1.0, v)
    return across, -sign * s, sign * c


@kernel
def _in_cylinder(cylinder, x, y):
    """Return (distance [m] to the wall, negative outside; x and y of its normal)."""
    dx, dy = x - cylinder[0], y - cylinder[1]
    radius = math.hypot(dx, dy)
    if radius == 0.0:
        return cylinder[2], 1.0, 0.0
    return cylinder[2] - radius, dx / radius, dy / radius


@kernel
def top(t, x, y):
    """Return (height [m], normal) of the highest surface."""
    height, a, b = field(t, x, y)
    normal = _normal(a, b)
    for i in range(t.boxes.shape[0]):
        if t.boxes[i, 7] > height and _in_box(t.boxes[i], x, y)[0] >= 0.0:
            height, normal = t.boxes[i, 7], UP
    for i in range(t.cylinders.shape[0]):
        if t.cylinders[i, 3] > height and _in_cylinder(t.cylinders[i], x, y)[0] >= 0.0:
            height, normal = t.cylinders[i, 3], UP
    return height, normal


@kernel
def _deeper(deepest, place, top_z, wall):
    """Return the deeper of a previous result and the depth in an obstacle, measured to its nearest face."""
    under = top_z - place[2]
    inside, x, y = wall
    if under <= 0.0 or inside <= 0.0:
        return deepest
    depth = min(under, inside)
    if depth <= deepest[0]:
        return deepest
    return (depth, UP) if under <= inside else (depth, (x, y, 0.0))


@kernel
def depth(t, place):
    """Return (depth [m] of a point in the ground or an obstacle, not positive outside; normal of the nearest face)."""
    height, a, b = field(t, place[0], place[1])
    normal = _normal(a, b)
    result = ((height - place[2]) * normal[2], normal)
    for i in range(t.boxes.shape[0]):
        result = _deeper(result, place, t.boxes[i, 7], _in_box(t.boxes[i], place[0], place[1]))
    for i in range(t.cylinders.shape[0]):
        result = _deeper(result, place, t.cylinders[i, 3], _in_cylinder(t.cylinders[i], place[0], place[1]))
    return result


@kernel
def ray(t, origin, direction, longest):
    """Return the distance [m] along a unit vector to the ground; inf beyond `longest`, 0 from within it."""
    before, after = 0.0, 0.0
    while True:
        x, y = origin[0] + after * direction[0], origin[1] + after * direction[1]
        gap = origin[2] + after * direction[2] - top(t, x, y)[0]
        if gap <= 0.0:
            break
        if after > longest:
            return math.inf
        before, after = after, after + max(FINEST, CAUTION * gap)
    for _ in range(HALVINGS):
        middle = 0.5 * (before + after)
        x, y = origin[0] + middle * direction[0], origin[1] + middle * direction[1]
        if origin[2] + middle * direction[2] > top(t, x, y)[0]:
            before = middle
        else:
            after = middle
    return after if after <= longest else math.inf


FINEST = 0.02  # [m] a ray may miss narrower objects
CAUTION = 0.25  # step of the march relative to the gap under the ray
HALVINGS = 50
