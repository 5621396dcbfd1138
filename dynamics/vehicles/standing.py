"""How a vehicle stands on the ground: at rest on its feet, before anything moves."""

import itertools
import math
from collections.abc import Sequence

from dynamics.effects._ground import Ground, surface
from dynamics.lie.quaternion import NO_ROTATION, Quaternion, from_matrix
from dynamics.vector import Mat3, Vec3, apply

ITERATIONS = 50  # the feet move sideways as the vehicle tilts; on a plane three are enough
CONVERGED = 1e-12  # change of the slope between two iterations
LEVEL = (0.0, 0.0)


def standing_pose(feet: Sequence[Vec3], ground: Ground | None) -> tuple[Vec3, Quaternion]:
    """Where a vehicle stands whose centre of mass is over the world's origin, heading along world x.

    It is tilted as the ground under its feet, and the lowest foot touches without pressing. Between bumps that is the
    plane through the three points of the ground that would carry it.

    Args:
        feet: points that may touch [m], body coordinates.
        ground: None for level ground at height 0.

    Returns:
        Position of the centre of mass [m] in the world, attitude.
    """
    if not feet:
        return (0.0, 0.0, 0.0), NO_ROTATION
    if ground is None or (ground.slope == LEVEL and ground.bump_height == 0.0):
        return (0.0, 0.0, -min(z for _, _, z in feet)), NO_ROTATION
    slope = ground.slope
    for _ in range(ITERATIONS):
        R_world_body = _aligned(slope)
        arms = [apply(R_world_body, foot) for foot in feet]
        heights = [surface(ground, x, y)[0] for x, y, _ in arms]
        before, slope = slope, _carrying([(x, y, h) for (x, y, _), h in zip(arms, heights, strict=True)]) or slope
        if math.dist(before, slope) < CONVERGED:
            break
    rise = max(height - arm[2] for arm, height in zip(arms, heights, strict=True))
    return (0.0, 0.0, rise), from_matrix(R_world_body)


def _aligned(slope: tuple[float, float]) -> Mat3:
    """R_world_body of a body that stands on a plane z = a x + b y, with its x axis over the world's."""
    a, b = slope
    forward, normal = 1.0 / math.hypot(1.0, a), 1.0 / math.sqrt(1.0 + a * a + b * b)
    x = (forward, 0.0, a * forward)
    z = (-a * normal, -b * normal, normal)
    y = (z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0])
    return (x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2])


def _carrying(points: Sequence[Vec3]) -> tuple[float, float] | None:
    """Slope of the highest plane over the origin through three of the points around it; None if there are none."""
    best: tuple[float, tuple[float, float]] | None = None
    for p, q, r in itertools.combinations(points, 3):
        twice_area = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
        if twice_area == 0.0:
            continue
        shares = [(s[0] * t[1] - s[1] * t[0]) / twice_area for s, t in ((q, r), (r, p), (p, q))]
        height = sum(share * point[2] for share, point in zip(shares, (p, q, r), strict=True))
        if min(shares) < -1e-9 or (best is not None and height <= best[0]):
            continue
        dq, dr = q[2] - p[2], r[2] - p[2]
        a = (dq * (r[1] - p[1]) - dr * (q[1] - p[1])) / twice_area
        b = (dr * (q[0] - p[0]) - dq * (r[0] - p[0])) / twice_area
        best = height, (a, b)
    return best and best[1]
