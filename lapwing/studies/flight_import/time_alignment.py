"""Time offset and drift between two clocks that recorded the same rotation."""

from typing import NamedTuple

import numpy as np

LONGEST = 0.25  # [s] offset that is looked for
SPAN = 5.0  # [s] of one estimate of the offset, for the drift
FEWEST = 4  # estimates that a drift needs
CLEAR = 0.6  # correlation of an estimate


class ClockDrift(NamedTuple):
    """Change of the offset between two clocks over a flight."""

    rate: float  # [s/s] slope of the offset, positive where the gyroscope's stream becomes later
    standard_error: float  # [s/s]
    spread: float  # [s] standard deviation of the offsets about the line
    spans: int  # estimates of the offset


def describe(turning: np.ndarray, omega: np.ndarray, valid: np.ndarray, interval: float) -> str:
    """Return offset, correlation and drift in words. See `time_offset` for arguments."""
    offset, correlation = time_offset(turning, omega, valid, interval)
    text = f"gyroscope {round(1e3 * offset):+d} ms against attitude, correlation {correlation:.2f}"
    drift = clock_drift(turning, omega, valid, interval)
    if drift is None:
        return f"{text}, drift unknown: needs {FEWEST} spans of {SPAN:g} s with motion"
    ppm, error = 1e6 * drift.rate, 1e6 * drift.standard_error
    return f"{text}, drift {ppm:+.0f} ppm (standard error {error:.0f}), jumps {1e3 * drift.spread:.0f} ms"


def clock_drift(turning: np.ndarray, omega: np.ndarray, valid: np.ndarray, interval: float) -> ClockDrift | None:
    """Return the line through the offsets of spans of the flight, or None if fewer than `FEWEST` are clear.

    Outliers are left out by twice their median distance from a line through medians (Theil and Sen). See `time_offset`
    for arguments.
    """
    from scipy.stats import theilslopes

    size = round(SPAN / interval)
    middles, offsets = [], []
    for begin in range(0, len(valid) - size + 1, size // 2):
        part = slice(begin, begin + size)
        offset, correlation = time_offset(turning[part], omega[part], valid[part], interval)
        if correlation > CLEAR and abs(offset) < LONGEST - interval:
            middles.append((begin + 0.5 * size) * interval)
            offsets.append(offset)
    if len(offsets) < FEWEST:
        return None
    time, late = np.array(middles), np.array(offsets)
    slope, intercept, *_ = theilslopes(late, time)
    distance = np.abs(late - intercept - slope * time)
    inliers = distance <= 2.0 * np.median(distance) + 1e-3 * interval
    if inliers.sum() < FEWEST:
        return None
    design = np.column_stack([np.ones(inliers.sum()), time[inliers]])
    line = np.linalg.lstsq(design, late[inliers], rcond=None)[0]
    rest = late[inliers] - design @ line
    spread = float(np.sqrt((rest**2).sum() / (inliers.sum() - 2)))
    # spans overlap by half, so about half as many are independent
    error = spread * np.sqrt(2.0 / ((time[inliers] - time[inliers].mean()) ** 2).sum())
    return ClockDrift(float(line[1]), float(error), spread, int(inliers.sum()))


def time_offset(turning: np.ndarray, omega: np.ndarray, valid: np.ndarray, interval: float) -> tuple[float, float]:
    """Return (offset [s], correlation) at which the gyroscope matches the rate of the attitude best.

    The offset is positive where the gyroscope's stream is late. A parabola through the best three samples of the
    correlation resolves fractions of an interval.

    Args:
        turning: [rad/s] rate of the measured attitude, shape (n, 3).
        omega: [rad/s] of the gyroscope, shape (n, 3).
        valid: samples to use, shape (n,).
        interval: [s] between two samples.
    """
    reach = round(LONGEST / interval)
    n = len(valid)
    if valid.sum() < 4 * reach or n < 4 * reach:
        return 0.0, 0.0
    a, b = (np.nan_to_num(v) - np.nan_to_num(v)[valid].mean(axis=0) for v in (turning, omega))
    a, b = np.where(valid[:, None], a, 0.0), np.where(valid[:, None], b, 0.0)
    inner = slice(reach, n - reach)
    norm = np.sqrt((a[inner] ** 2).sum() * (b[inner] ** 2).sum())
    if norm == 0.0:
        return 0.0, 0.0
    scores = np.array([(a[reach - k : n - reach - k] * b[inner]).sum() for k in range(-reach, reach + 1)]) / norm
    best = int(scores.argmax())
    fraction = 0.0
    if 0 < best < 2 * reach:
        left, middle, right = scores[best - 1 : best + 2]
        fraction = 0.5 * (left - right) / (left - 2.0 * middle + right)
    return float((best - reach + fraction) * interval), float(scores[best])
