"""The ground: a plane, level or sloped, with or without bumps."""

import math
from typing import NamedTuple

from dynamics.kernel import kernel, leaf
from dynamics.vector import Vec3


class Ground(NamedTuple):
    """Height a x + b y + A sin(k x) sin(k y) of the ground over the world's horizontal plane."""

    slope: tuple[float, float]
    bump_height: float  # [m] A
    bump_wavenumber: float  # [rad/m] k
    normal: Vec3  # of the ground without bumps


@leaf
def clearance(ground, position_world):
    """[m] above the ground without its bumps, measured along world z."""
    return position_world[2] - ground.slope[0] * position_world[0] - ground.slope[1] * position_world[1]


@leaf
def surface(ground, x, y):
    """(height [m], rise along x, rise along y, normal) of the ground at a point."""
    if ground.bump_height == 0.0:
        return ground.slope[0] * x + ground.slope[1] * y, ground.slope, ground.normal
    return _bumpy(ground, x, y)


@kernel
def _bumpy(ground, x, y):
    h, k = ground.bump_height, ground.bump_wavenumber
    sx, cx, sy, cy = math.sin(k * x), math.cos(k * x), math.sin(k * y), math.cos(k * y)
    a, b = ground.slope[0] + h * k * cx * sy, ground.slope[1] + h * k * sx * cy
    height = ground.slope[0] * x + ground.slope[1] * y + h * sx * sy
    steep = 1.0 / math.sqrt(1.0 + a * a + b * b)
    return height, (a, b), (-a * steep, -b * steep, steep)
