"""Downsampling of long lines to the resolution of a screen; the extremes of short intervals are preserved."""

import numpy as np

from lapwing.studies.report.plot import Line
from lapwing.studies.report.style import POINTS


def thin(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return about POINTS samples of a line without gaps, shapes (n,), including its ends and extremes."""
    if len(y) <= POINTS:
        return x, y
    rows = extremes(y)
    return x[rows], y[rows]


def extremes(y: np.ndarray) -> np.ndarray:
    """Return the sorted indices of both ends, and of minimum and maximum of each of POINTS / 2 intervals."""
    length = -(-2 * len(y) // POINTS)
    intervals = np.pad(y, (0, -len(y) % length), mode="edge").reshape(-1, length)
    starts = length * np.arange(len(intervals))
    rows = np.concatenate([[0], starts + intervals.argmin(axis=1), starts + intervals.argmax(axis=1), [len(y) - 1]])
    return np.unique(rows.clip(max=len(y) - 1))


def subsample(values: np.ndarray) -> np.ndarray:
    """Return every k-th sample and the last, shape (m, ...), for data without a time axis: a path, a point cloud."""
    step = max(1, -(-len(values) // POINTS))
    rows = values[::step]
    return rows if (len(values) - 1) % step == 0 else np.concatenate([rows, values[-1:]])


def downsample(mark: Line, of_x: bool) -> Line:
    """Return the downsampled line, a function of x if `of_x`, otherwise a path; a line with gaps stays unchanged."""
    if len(mark.x) <= POINTS or np.isnan(mark.y).any():
        return mark
    if of_x:
        x, y = thin(mark.x, mark.y)
        return mark._replace(x=x, y=y)
    return mark._replace(x=subsample(mark.x), y=subsample(mark.y), z=None if mark.z is None else subsample(mark.z))
