"""Covariance inflation after repeated rejections of a source (theory, section 3.4).

Readings that are rejected for a long time indicate a wrong estimate. Its covariance grows until they are accepted.
"""

import numpy as np

from lapwing.dynamics.vector import ZERO
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
    LIFT,
    MAG,
    MAG_SCALE,
    NEVER,
    POSITION,
    SIZE,
    THETA,
    VELOCITY,
    WIND,
    Memory,
    Nominal,
    State,
    correlate_warm_up,
)

_MOTION = 0.3  # [s] of rejected position and velocity before the IMU states are inflated
_POSITION_ONLY = 3.0  # [s] of rejected position, for a receiver without velocity
_LONG = 10.0  # [s] of rejection, for any other source


@always_inline
def _inflate(c: np.ndarray, start: int, deviation: float) -> None:
    for i in range(start, start + 3):
        c[i, i] += deviation * deviation


@always_inline
def inflate_imu_states(m: Memory) -> None:
    """Inflate the covariance of the states that depend on the IMU, and reset the innovation trend."""
    c = m.covariance
    _inflate(c, THETA, 0.02)
    _inflate(c, VELOCITY, 0.3)
    _inflate(c, POSITION, 0.1)
    _inflate(c, GYRO, 5e-3)
    _inflate(c, ACCELEROMETER, 0.1)
    m.trend[:] = 0.0


@kernel
def inflate_covariance(p: Estimator, m: Memory, source: int) -> None:
    """Inflate the covariance after the gate rejected a reading of `source`."""
    c = m.covariance
    rejected_long = m.since[source] * p.interval > _LONG
    if source == GPS_VELOCITY:
        inflate_imu = m.rejected[GPS] == 1 and min(m.since[GPS_VELOCITY], m.since[GPS]) * p.interval > _MOTION
    else:
        position_only = m.since[GPS_VELOCITY] == NEVER and m.since[GPS] * p.interval > _POSITION_ONLY
        inflate_imu = source == GPS and position_only
    if inflate_imu:
        inflate_imu_states(m)
    elif source == GPS and rejected_long:
        _inflate(c, POSITION, 3.0)
    elif source == BARO and rejected_long:
        c[BAROMETER, BAROMETER] += 1.0
    elif source == MAG and rejected_long:
        _inflate(c, IRON, 2e-6)


@kernel
def reset_imu_biases(p: Estimator, s: State) -> State:
    """Return the state with unknown inertial biases, for a change to another unit.

    Args:
        p: `Estimator`.
        s: `State`; its arrays are changed in place.
    """
    c, n = s.memory.covariance, s.nominal
    for i in range(3):
        for k, deviation in ((GYRO + i, p.gyro_bias_std), (ACCELEROMETER + i, p.accelerometer_bias_std)):
            c[k, :] = 0.0
            c[:, k] = 0.0
            c[k, k] = deviation * deviation
            s.memory.considered[k, :] = 0.0
    s.memory.considered[:SIZE, :MAG_SCALE] = 0.0
    s.memory.considered[:SIZE, LIFT:WIND] = 0.0
    correlate_warm_up(p, s.memory, s.inertial.tick)
    nominal = Nominal(
        n.attitude, n.velocity_world, n.position_world, ZERO, ZERO, n.gps_correlated_error,
        n.magnetometer_bias, n.heading_bias, n.barometer_bias, n.sonar_scale,
    )  # fmt: skip
    return State(nominal, s.inertial, s.memory)
