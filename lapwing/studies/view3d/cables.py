"""Shape of cables and rigid links between bodies."""

import numpy as np

PARTS = 12  # number of segments of a drawn cable


def cable(start: np.ndarray, stop: np.ndarray, length: float) -> np.ndarray:
    """Return points from `start` to `stop` [m], shape (PARTS + 1, 3); they sag if `length` [m] exceeds the distance."""
    points = np.linspace(start, stop, PARTS + 1)
    if length > float(np.linalg.norm(stop - start)):
        points += _sag(start, stop, length)
    return points


def _sag(start: np.ndarray, stop: np.ndarray, length: float) -> np.ndarray:
    """Return the offsets of a slack cable from its chord [m], a parabola of about its length, shape (PARTS + 1, 3)."""
    chord = stop - start
    distance = float(np.linalg.norm(chord))
    depth = np.sqrt(3.0 * distance * (length - distance) / 8.0) if distance > 0.0 else length / 2.0
    down = np.array([0.0, 0.0, -1.0])
    across = down - chord * float(down @ chord) / max(distance * distance, 1e-9)
    size = float(np.linalg.norm(across))
    across = across / size if size > 1e-3 else np.array([1.0, 0.0, 0.0])  # a vertical chord bends to one side
    share = np.linspace(0.0, 1.0, PARTS + 1)
    return (depth * 4.0 * share * (1.0 - share))[:, None] * across
