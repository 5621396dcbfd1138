"""Time offset between two clocks that recorded the same rotation."""

import numpy as np

LONGEST = 0.25  # [s] offset that is looked for


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
