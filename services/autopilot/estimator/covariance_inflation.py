"""What to stop believing when a source is refused again and again (theory.md, section 3.4).

A reading is refused because it contradicts the estimate; when that lasts, the estimate may be what is wrong. Doubt
widens the covariance of what the source speaks about, until its readings are taken again.
"""

import numpy as np

from lapwing.kernels import always_inline, kernel
from lapwing.services.autopilot.estimator.filter_parameters import Estimator
from lapwing.services.autopilot.estimator.filter_state import (
    ACCELEROMETER,
    BARO,
    BAROMETER,
    GPS,
    GPS_VELOCITY,
    GYRO,
    IRON,
    MAG,
    NEVER,
    POSITION,
    THETA,
    VELOCITY,
    Memory,
)

_MOTION = 0.3  # [s] position and velocity refused together for so long: the inertial unit is doubted
_LONE = 3.0  # [s] the same for the position of a receiver that gives no velocity
_LONG = 10.0  # [s] any other source


@always_inline
def _widen(c: np.ndarray, start: int, deviation: float) -> None:
    for i in range(start, start + 3):
        c[i, i] += deviation * deviation


@kernel
def doubt(p: Estimator, m: Memory, source: int) -> None:
    """Widen the covariance after a reading of `source` was refused by the gate."""
    c = m.covariance
    for_long = m.since[source] * p.interval > _LONG
    if source == GPS_VELOCITY:
        imu_doubted = m.refused[GPS] == 1 and min(m.since[GPS_VELOCITY], m.since[GPS]) * p.interval > _MOTION
    else:
        lone = m.since[GPS_VELOCITY] == NEVER and m.since[GPS] * p.interval > _LONE
        imu_doubted = source == GPS and lone
    if imu_doubted:
        _widen(c, THETA, 0.02)
        _widen(c, VELOCITY, 0.3)
        _widen(c, POSITION, 0.1)
        _widen(c, GYRO, 5e-3)
        _widen(c, ACCELEROMETER, 0.1)
    elif source == GPS and for_long:
        _widen(c, POSITION, 3.0)
    elif source == BARO and for_long:
        c[BAROMETER, BAROMETER] += 1.0
    elif source == MAG and for_long:
        _widen(c, IRON, 2e-6)
