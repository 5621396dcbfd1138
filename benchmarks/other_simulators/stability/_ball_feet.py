"""Vehicle with balls as feet, for simulators with contact between shapes, and its toppling angle."""

import math
from collections.abc import Callable
from functools import partial

from lapwing.studies.stability.cases import landing, toppling

RADIUS = 0.01  # [m] radius of the ball of a foot
BALLS = [(x, y, z + RADIUS) for x, y, z in toppling.FEET]  # [m] centres of the balls, body frame


def set_down(axis: int, angle: float) -> tuple[float, tuple[float, float, float, float]]:
    """Return height [m] and attitude of the vehicle tilted by an angle [rad] with two balls in contact."""
    height = toppling.base(axis) * math.sin(angle) + (landing.HEIGHT - RADIUS) * math.cos(angle) + RADIUS
    x, y, z = (math.sin(0.5 * angle) * u for u in toppling.unit(axis))
    return height, (math.cos(0.5 * angle), x, y, z)


def toppled(axis: int, R_world_body_33: float) -> bool:
    """Return True if it is tilted beyond the edge of its feet."""
    return R_world_body_33 < math.cos(toppling.edge(axis))


def error(falls: Callable[[int, float], bool]) -> float:
    """Return the error of the toppling angle [rad] of a tilted vehicle, the larger of both axes.

    A ball touches below its centre: the edge is that of the centres.
    """
    result = []
    for axis in toppling.AXES:
        exact = math.atan(toppling.base(axis) / (landing.HEIGHT - RADIUS))
        at = toppling.threshold(partial(falls, axis), exact - 0.1, exact + 0.1, 34)
        result.append(abs(at - exact))
    return max(result)
