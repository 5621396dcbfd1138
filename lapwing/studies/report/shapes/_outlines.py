"""Outlines of simple solids, as lines through points."""

import numpy as np


def box(length: float, width: float, height: float) -> np.ndarray:
    """The edges of a box about the origin, shape (m, 3), as one line that goes over some of them twice."""
    x, y, z = length / 2.0, width / 2.0, height / 2.0
    around = [(-x, -y), (x, -y), (x, y), (-x, y), (-x, -y)]
    points = [(a, b, -z) for a, b in around] + [(a, b, z) for a, b in around]
    for a, b in around[1:-1]:
        points += [(a, b, z), (a, b, -z), (a, b, z)]
    return np.array(points)


def circle(radius: float, axis: int = 2) -> np.ndarray:
    """A circle about one of the axes, shape (25, 3)."""
    angle = np.linspace(0.0, 2.0 * np.pi, 25)
    points = np.zeros((25, 3))
    points[:, (axis + 1) % 3], points[:, (axis + 2) % 3] = radius * np.cos(angle), radius * np.sin(angle)
    return points
