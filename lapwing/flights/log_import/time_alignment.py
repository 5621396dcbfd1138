"""Time offset and drift between two clocks that recorded the same rotation."""

from typing import NamedTuple

import numpy as np

LONGEST = 0.25  # [s] largest offset of the search
SPAN = 5.0  # [s] duration of one estimate of the offset, for the drift
FEWEST = 4  # minimum number of estimates for a drift
STILL = 1e-9  # [rad^2/s^2] sum of squares below which there is no motion
TURNING = 0.05  # [rad/s] standard deviation of the attitude's rate above which a gyroscope must follow it
CLEAR = 0.6  # minimum correlation of an estimate


class ClockDrift(NamedTuple):
    """Change of the offset between two clocks over a flight."""

    rate: float  # [s/s] slope of the offset, positive if the delay of the gyroscope increases
    standard_error: float  # [s/s]
    spread: float  # [s] standard deviation of the offsets about the line
    spans: int  # number of estimates of the offset


def describe(attitude_rate: np.ndarray, omega: np.ndarray, valid: np.ndarray, interval: float) -> str:
    """Return a text on offset, correlation and drift. See `time_offset` for arguments."""
    offset, correlation = time_offset(attitude_rate, omega, valid, interval)
    offset += 0.5 * interval  # the rate between two attitudes is that at the midpoint
    text = f"gyroscope {round(1e3 * offset):+d} ms against attitude, correlation {correlation:.2f}"
    if correlation < CLEAR and valid.any() and np.nanstd(attitude_rate[valid]) > TURNING:
        text += " although the vehicle turns: check the frames of both"
    drift = clock_drift(attitude_rate, omega, valid, interval)
    if drift is None:
        return f"{text}, drift unknown: needs {FEWEST} spans of {SPAN:g} s with motion"
    ppm, error = 1e6 * drift.rate, 1e6 * drift.standard_error
    return f"{text}, drift {ppm:+.0f} ppm (standard error {error:.0f}), jumps {1e3 * drift.spread:.0f} ms"


def clock_drift(attitude_rate: np.ndarray, omega: np.ndarray, valid: np.ndarray, interval: float) -> ClockDrift | None:
    """Return a linear fit to the offsets of spans of the flight, or None if fewer than `FEWEST` are significant.

    Outliers beyond twice the median distance from a robust line (Theil and Sen) are excluded. See `time_offset` for
    arguments.
    """
    from scipy.stats import theilslopes

    size = round(SPAN / interval)
    middles, offsets = [], []
    for begin in range(0, len(valid) - size + 1, size // 2):
        part = slice(begin, begin + size)
        offset, correlation = time_offset(attitude_rate[part], omega[part], valid[part], interval)
        if correlation > CLEAR and abs(offset) < LONGEST - interval:
            middles.append((begin + 0.5 * size) * interval)
            offsets.append(offset)
    if len(offsets) < FEWEST:
        return None
    time, delay = np.array(middles), np.array(offsets)
    slope, intercept, *_ = theilslopes(delay, time)
    distance = np.abs(delay - intercept - slope * time)
    inliers = distance <= 2.0 * np.median(distance) + 1e-3 * interval
    if inliers.sum() < FEWEST:
        return None
    design = np.column_stack([np.ones(inliers.sum()), time[inliers]])
    line = np.linalg.lstsq(design, delay[inliers], rcond=None)[0]
    residual = delay[inliers] - design @ line
    spread = float(np.sqrt((residual**2).sum() / (inliers.sum() - 2)))
    # spans overlap by half, so about half as many are independent
    error = spread * np.sqrt(2.0 / ((time[inliers] - time[inliers].mean()) ** 2).sum())
    return ClockDrift(float(line[1]), float(error), spread, int(inliers.sum()))


def time_offset(
    attitude_rate: np.ndarray, omega: np.ndarray, valid: np.ndarray, interval: float
) -> tuple[float, float]:
    """Return (offset [s], correlation) of the best match between gyroscope and rate of the attitude.

    The offset is positive if the gyroscope is delayed. A parabola through the best three samples of the correlation
    resolves fractions of an interval.

    Args:
        attitude_rate: rate of the measured attitude [rad/s], shape (n, 3).
        omega: rate of the gyroscope [rad/s], shape (n, 3).
        valid: True for samples to use, shape (n,).
        interval: time between two samples [s].
    """
    reach = round(LONGEST / interval)
    n = len(valid)
    if valid.sum() < 4 * reach or n < 4 * reach:
        return 0.0, 0.0
    a, b = (np.nan_to_num(v) - np.nan_to_num(v)[valid].mean(axis=0) for v in (attitude_rate, omega))
    a, b = np.where(valid[:, None], a, 0.0), np.where(valid[:, None], b, 0.0)
    late = b[reach : n - reach] - b[reach : n - reach].mean(axis=0)
    scores = np.zeros(2 * reach + 1)
    for k in range(-reach, reach + 1):  # each window has its own mean and norm: slow motion changes them
        early = a[reach - k : n - reach - k] - a[reach - k : n - reach - k].mean(axis=0)
        if (norm := np.sqrt((early**2).sum() * (late**2).sum())) > STILL:
            scores[k + reach] = (early * late).sum() / norm
    if not scores.any():
        return 0.0, 0.0
    best = int(scores.argmax())
    fraction = 0.0
    if 0 < best < 2 * reach:
        left, middle, right = scores[best - 1 : best + 2]
        fraction = 0.5 * (left - right) / (left - 2.0 * middle + right)
    return float((best - reach + fraction) * interval), float(scores[best])
