"""A vehicle on balls instead of points: what simulators of contact between shapes stand on, and when it topples."""

import math
from collections.abc import Callable
from functools import partial

from lapwing.studies.stability.cases import landing, toppling

RADIUS = 0.01  # [m] of the ball that stands for a foot
BALLS = [(x, y, z + RADIUS) for x, y, z in toppling.FEET]  # their middles [m], body frame


def set_down(axis: int, angle: float) -> tuple[float, tuple[float, float, float, float]]:
    """Height [m] and attitude of the vehicle leaning by an angle [rad], two of its balls just touching."""
    height = toppling.base(axis) * math.sin(angle) + (landing.HEIGHT - RADIUS) * math.cos(angle) + RADIUS
    x, y, z = (math.sin(0.5 * angle) * u for u in toppling.unit(axis))
    return height, (math.cos(0.5 * angle), x, y, z)


def toppled(axis: int, R_world_body_33: float) -> bool:
    """Return True if it leans over the edge of its feet."""
    return R_world_body_33 < math.cos(toppling.edge(axis))


def error(falls: Callable[[int, float], bool]) -> float:
    """Error of the angle [rad] at which a vehicle that is set down leaning topples, the larger of both axes.

    A ball touches under its middle: the edge is that of the balls' middles.
    """
    result = []
    for axis in toppling.AXES:
        exact = math.atan(toppling.base(axis) / (landing.HEIGHT - RADIUS))
        at = toppling.threshold(partial(falls, axis), exact - 0.1, exact + 0.1, 34)
        result.append(abs(at - exact))
    return max(result)
