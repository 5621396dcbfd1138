"""Terrain queries for every kind of terrain, in Python and in compiled code."""

from typing import Any, NamedTuple

from lapwing.dynamics.terrain.heightfield import UP, depth, top
from lapwing.dynamics.vector import Vec3, dot
from lapwing.kernels.codegen import overload_for


class Level(NamedTuple):
    """Level ground at world z = 0."""


LEVEL = Level()


def upright(terrain: Any) -> Vec3:
    """Return the vector whose product with a position [m] is the height along world z above the plane of the slope."""
    return UP if isinstance(terrain, Level) else (-terrain.slope[0], -terrain.slope[1], 1.0)


@overload_for(upright, inline=True)
def _upright(terrain):
    if terrain.instance_class is Level:
        return lambda terrain: UP
    return lambda terrain: (-terrain.slope[0], -terrain.slope[1], 1.0)


def over_plane(terrain: Any, vector_world: Vec3) -> float:
    """Return world z of a point [m], or of a velocity [m/s], above the plane of the slope."""
    return vector_world[2] if isinstance(terrain, Level) else dot(upright(terrain), vector_world)


@overload_for(over_plane, inline=True)
def _over_plane(terrain, vector_world):
    if terrain.instance_class is Level:
        return lambda terrain, vector_world: vector_world[2]
    return lambda terrain, vector_world: dot(upright(terrain), vector_world)


def summit(terrain: Any) -> float:
    """Return the maximum height [m] of the terrain above that plane."""
    return 0.0 if isinstance(terrain, Level) else terrain.summit


@overload_for(summit, inline=True)
def _summit(terrain):
    return (lambda terrain: 0.0) if terrain.instance_class is Level else (lambda terrain: terrain.summit)


def surface(terrain: Any, x: float, y: float) -> tuple[float, Vec3]:
    """Return (height [m], normal) of the highest surface at world x and y [m]."""
    return (0.0, UP) if isinstance(terrain, Level) else top(terrain, x, y)


@overload_for(surface, inline=True)
def _surface(terrain, x, y):
    if terrain.instance_class is Level:
        return lambda terrain, x, y: (0.0, UP)
    return lambda terrain, x, y: top(terrain, x, y)


def touch(terrain: Any, place_world: Vec3) -> tuple[float, Vec3, float]:
    """Return (depth [m] of a point in the ground, not positive in the air; normal; wedge factor).

    The depth is the distance to the nearest point outside, and the normal points there. The wedge factor is the sum of
    the normal forces of all faces over their resultant: 1, and more in inner corners (theory, section 2.9).
    """
    return (-place_world[2], UP, 1.0) if isinstance(terrain, Level) else depth(terrain, place_world)


@overload_for(touch, inline=True)
def _touch(terrain, place_world):
    if terrain.instance_class is Level:
        return lambda terrain, place_world: (-place_world[2], UP, 1.0)
    return lambda terrain, place_world: depth(terrain, place_world)
