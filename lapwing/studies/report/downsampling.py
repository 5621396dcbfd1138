"""Downsampling of long lines to what a screen shows; the extremes of short intervals are kept."""

import numpy as np

from lapwing.studies.report.plot import Line
from lapwing.studies.report.style import POINTS


def thin(x: np.ndarray, y: np.ndarray, points: int = POINTS) -> tuple[np.ndarray, np.ndarray]:
    """Return about `points` samples of a line without gaps, shapes (n,), including its ends and extremes."""
    if len(y) <= points:
        return x, y
    rows = extremes(y, points)
    return x[rows], y[rows]


def extremes(y: np.ndarray, points: int = POINTS) -> np.ndarray:
    """Return the sorted indices of minimum and maximum of each of points / 2 intervals, and of both ends."""
    length = -(-2 * len(y) // points)
    stretches = np.pad(y, (0, -len(y) % length), mode="edge").reshape(-1, length)
    starts = length * np.arange(len(stretches))
    rows = np.concatenate([[0], starts + stretches.argmin(axis=1), starts + stretches.argmax(axis=1), [len(y) - 1]])
    return np.unique(rows.clip(max=len(y) - 1))


def every(values: np.ndarray, points: int = POINTS) -> np.ndarray:
    """Return every k-th sample and the last, shape (m, ...), of data without a time axis: a path, a point cloud."""
    step = max(1, -(-len(values) // points))
    rows = values[::step]
    return rows if (len(values) - 1) % step == 0 else np.concatenate([rows, values[-1:]])


def drawn(mark: Line, of_x: bool) -> Line:
    """Return the downsampled line, as a function of x or a path; one with gaps stays unchanged."""
    if len(mark.x) <= POINTS or np.isnan(mark.y).any():
        return mark
    if of_x:
        x, y = thin(mark.x, mark.y)
        return mark._replace(x=x, y=y)
    return mark._replace(x=every(mark.x), y=every(mark.y), z=None if mark.z is None else every(mark.z))
