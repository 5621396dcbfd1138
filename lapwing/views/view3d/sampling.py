"""Indices of samples by time, and rounded quaternions, which compress well in a recording."""

from itertools import pairwise
from typing import Any

import numpy as np

GRID = 2048.0  # positions and quaternions are rounded to 1 / GRID, which keeps a recording small
ANGLES = 48  # number of angles of a drawn propeller in a revolution
NEAR_ZERO = 1e-9


def nearest(sample_times: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return the index of the last of `sample_times` [s] at or before each of `times` [s], at least 0."""
    return (np.searchsorted(sample_times, np.asarray(times) + 1e-9, side="right") - 1).clip(0, len(sample_times) - 1)


def along(direction: np.ndarray) -> np.ndarray:
    """Return quaternions w, x, y, z, shape (k, 4), that rotate z to each direction; identity for vectors near zero."""
    length = np.linalg.norm(direction, axis=1)
    unit = np.where(length[:, None] > NEAR_ZERO, direction / np.maximum(length, NEAR_ZERO)[:, None], (0.0, 0.0, 1.0))
    w, x, y = 1.0 + unit[:, 2], -unit[:, 1], unit[:, 0]
    down = w < 1e-6
    result = np.column_stack([np.where(down, 0.0, w), np.where(down, 1.0, x), np.where(down, 0.0, y), 0.0 * w])
    return round_to_grid(result / np.linalg.norm(result, axis=1)[:, None])


def dashes(path: np.ndarray, length: float, most: int) -> np.ndarray:
    """Return segments of a dashed line along a path, shape (k, 2, 3).

    Args:
        path: points [m], shape (n, 3); there are no dashes at points with NaN.
        length: length of a dash and of a gap [m]; longer if there were more than `most` dashes.
    """
    steps = np.nan_to_num(np.linalg.norm(np.diff(path, axis=0), axis=1))
    way = np.concatenate([[0.0], np.cumsum(steps)])
    length = max(length, 0.5 * way[-1] / most)
    starts = np.arange(0.0, way[-1] - length, 2.0 * length)
    ends = np.stack([starts, starts + length], axis=1)
    result = np.stack([np.interp(ends, way, values) for values in path.T], axis=2)
    return result[np.isfinite(result).all(axis=(1, 2))]


def thin_path(path: np.ndarray, tolerance: float) -> np.ndarray:
    """Return ascending indices of the points of a path that suffice to draw it, with the first and the last.

    Args:
        path: points at equal time steps, shape (n, k), n >= 2; the first and the last of a gap (NaN) are kept, too.
        tolerance: largest distance between a point and the straight line between the remaining points at its time.

    Source: Douglas, Peucker, 1973, with the distance at equal times instead of the shortest one.
    """
    keep = np.zeros(len(path), bool)
    keep[[0, -1]] = True
    missing = np.isnan(path).any(axis=1)
    borders = np.flatnonzero(missing[1:] != missing[:-1])
    keep[borders] = keep[borders + 1] = True
    pieces = list(pairwise(np.flatnonzero(keep).tolist()))
    while pieces:
        first, last = pieces.pop()
        if last - first < 2 or missing[first]:
            continue
        share = np.linspace(0.0, 1.0, last - first + 1)[:, None]
        apart = np.linalg.norm(path[first : last + 1] - (1.0 - share) * path[first] - share * path[last], axis=1)
        worst = first + int(np.argmax(apart))
        if apart[worst - first] > tolerance:
            keep[worst] = True
            pieces += [(first, worst), (worst, last)]
    return np.flatnonzero(keep)


def round_angle(angle: np.ndarray) -> np.ndarray:
    """Return angles [rad] rounded to 1 / ANGLES of a revolution."""
    step = 2.0 * np.pi / ANGLES
    return np.remainder(np.round(angle / step), ANGLES) * step


def round_to_grid(values: Any) -> np.ndarray:
    """Return values rounded to 1 / GRID."""
    return np.round(np.asarray(values, float) * GRID) / GRID
