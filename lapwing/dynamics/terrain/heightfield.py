"""Relief: a height over each point of the horizontal plane, and obstacles with level tops."""

from typing import NamedTuple

import numpy as np

from lapwing.dynamics.vector import add, dot, scale
from lapwing.kernels import kernel, math, noinline

UP = (-0.0, -0.0, 1.0)  # normal of level ground


class Relief(NamedTuple):
    """Ground that is not level."""

    slope: tuple[float, float]  # slope of the plane along world x and y
    bump_height: float  # [m] A of bumps A sin(k x) sin(k y)
    bump_wavenumber: float  # [rad/m] k
    base: float  # [m] height at home without bumps and grid
    grid: np.ndarray  # (rows along y, columns along x) heights [m] with the border of `BORDER`; (0, 0): none
    corner: tuple[float, float]  # [m] world x and y of grid[0, 0]
    spacing: float  # [m] spacing of the grid
    grid_slope: float  # bound of the slope of the grid
    boxes: np.ndarray  # (n, 8) x, y of a point, cosine, sine of the heading, ends along it, half width, z of the top
    cylinders: np.ndarray  # (n, 4) x, y of the axis, radius, z of the top
    summit: float  # [m] largest height of the terrain above the plane through the origin with that slope


@kernel
def _cubic(a, b, c, d, p):
    """Return (value, derivative) at p between b (p = 0) and c (p = 1), with central differences as slopes there."""
    rise, first, last = c - b, 0.5 * (c - a), 0.5 * (d - b)
    square, cube = 3.0 * rise - 2.0 * first - last, first + last - 2.0 * rise
    return b + p * (first + p * (square + p * cube)), first + p * (2.0 * square + 3.0 * p * cube)


@noinline
def _between(t, x, y):
    """Return (height, slope along x, slope along y) of the grid by cubic convolution (theory, eq. (2.82)).

    Outside, the slope at the edge decreases linearly to 0 within one spacing.
    """
    rows, columns = t.grid.shape
    column, row = (x - t.corner[0]) / t.spacing, (y - t.corner[1]) / t.spacing
    # nearest place in the grid, and the way from there in spacings; this order of arguments maps NaN to the edge
    u, v = min(max(2.0, column), columns - 3.0), min(max(2.0, row), rows - 3.0)
    out_x, out_y = min(max(-1.0, column - u), 1.0), min(max(-1.0, row - v), 1.0)
    i, j, g = int(v), int(u), t.grid
    p, q = u - j, v - i
    a, along_a = _cubic(g[i - 1, j - 1], g[i - 1, j], g[i - 1, j + 1], g[i - 1, j + 2], p)
    b, along_b = _cubic(g[i, j - 1], g[i, j], g[i, j + 1], g[i, j + 2], p)
    c, along_c = _cubic(g[i + 1, j - 1], g[i + 1, j], g[i + 1, j + 1], g[i + 1, j + 2], p)
    d, along_d = _cubic(g[i + 2, j - 1], g[i + 2, j], g[i + 2, j + 1], g[i + 2, j + 2], p)
    height, across = _cubic(a, b, c, d, q)
    along, twist = _cubic(along_a, along_b, along_c, along_d, q)
    far_x, far_y = out_x - 0.5 * out_x * abs(out_x), out_y - 0.5 * out_y * abs(out_y)
    return (
        height + along * far_x + across * far_y + twist * far_x * far_y,
        (along + twist * far_y) * (1.0 - abs(out_x)) / t.spacing,
        (across + twist * far_x) * (1.0 - abs(out_y)) / t.spacing,
    )


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
def _obstacle(t, i, place):
    """Return (depth [m] under the top of an obstacle, distance [m] to its nearest wall, x and y of that wall's normal).

    Obstacles are numbered boxes first; distances are negative outside.
    """
    n = t.boxes.shape[0]
    if i < n:
        inside, x, y = _in_box(t.boxes[i], place[0], place[1])
        return t.boxes[i, 7] - place[2], inside, x, y
    inside, x, y = _in_cylinder(t.cylinders[i - n], place[0], place[1])
    return t.cylinders[i - n, 3] - place[2], inside, x, y


@kernel
def _corner(a, b):
    """Return (depth, normal, wedge factor) in front of two faces: the way to the nearest point outside both."""
    p, q, cosine = a[0], b[0], dot(a[1], b[1])
    if q <= cosine * p and (p > 0.0 or q <= p):
        return a
    if p <= cosine * q and (q > 0.0 or p <= q):
        return b
    sine_squared = 1.0 - cosine * cosine
    if sine_squared < PARALLEL:
        if cosine < 0.0:
            return BLOCKED, a[1], 1.0
        return a if p > q else b
    i, j = (p - cosine * q) / sine_squared, (q - cosine * p) / sine_squared
    way = add(scale(i, a[1]), scale(j, b[1]))
    depth = math.sqrt(dot(way, way))
    return depth, scale(1.0 / depth, way), (i * a[2] + j * b[2]) / depth


@kernel
def _outward(t, ground, deepest, place, level):
    """Return (depth, normal, wedge factor) of the way over one obstacle and out of the walls of all higher ones.

    Args:
        t: terrain.
        ground: (depth, normal, wedge factor) in the ground without obstacles.
        deepest: [m] largest depth in the ground or an obstacle; walls further away than that are out of reach.
        place: [m] point.
        level: number of the obstacle, -1 for the ground without obstacles.
    """
    walls, floor, under_level, found = ground, ground, -math.inf, False
    if level >= 0:
        under_level = _obstacle(t, level, place)[0]
        floor = _corner(ground, (under_level, UP, 1.0))
    for i in range(t.boxes.shape[0] + t.cylinders.shape[0]):
        under, inside, x, y = _obstacle(t, i, place)
        if under > max(under_level, 0.0) and inside > -deepest:
            wall = (inside, (x, y, 0.0), 1.0)
            walls, found = _corner(walls, wall) if found else wall, True
    return _corner(walls, floor) if found else floor


@noinline
def _among_obstacles(t, ground, place):
    """Return the result of `depth` from that of the ground without obstacles."""
    deepest, n = ground[0], t.boxes.shape[0] + t.cylinders.shape[0]
    for i in range(n):
        under, inside, _, _ = _obstacle(t, i, place)
        deepest = max(deepest, min(under, inside))
    if not deepest > 0.0:
        return ground
    best = _outward(t, ground, deepest, place, -1)
    for level in range(n):
        under, inside, _, _ = _obstacle(t, level, place)
        if under > 0.0 and inside > -deepest:
            over = _outward(t, ground, deepest, place, level)
            if over[0] <= best[0]:
                best = over
    return best


@kernel
def depth(t, place):
    """Return (depth [m] of a point, not positive outside; normal; wedge factor): theory, eq. (2.80) and (2.81)."""
    height, a, b = field(t, place[0], place[1])
    normal = _normal(a, b)
    ground = ((height - place[2]) * normal[2], normal, 1.0)
    if t.boxes.shape[0] + t.cylinders.shape[0] == 0:
        return ground
    return _among_obstacles(t, ground, place)


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


BORDER = 2  # samples outside the edge of a grid: one on the line of the last two, and one without influence
FINEST = 0.02  # [m] a ray may miss narrower objects
CAUTION = 0.25  # step of the march relative to the gap under the ray
HALVINGS = 50
BLOCKED = 1e30  # [m] depth between opposite faces, which no way leads out of
PARALLEL = 1e-9  # squared sine of the angle between two faces that count as one plane
