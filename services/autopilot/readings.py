"""Sensor messages as the estimator's arguments: the inverse of what the sensors write, validity included.

`age` is the age of the measurement in IMU ticks.
"""

import math
from typing import Any

from dynamics.vector import Vec3


def imu(m: Any) -> tuple[Vec3, Vec3, float, float, bool]:
    """omega_body, specific_force_body, their variances, valid."""
    variance, force_variance = m.angular_velocity_covariance[0], m.linear_acceleration_covariance[0]
    valid = variance >= 0.0 and force_variance >= 0.0
    return tuple(m.angular_velocity), tuple(m.linear_acceleration), variance, force_variance, valid


def magnetometer(m: Any, age: int) -> tuple[Vec3, float, bool]:
    """field_body, variance, valid."""
    return tuple(m.magnetic_field), m.magnetic_field_covariance[0], not math.isnan(m.magnetic_field.x)


def gps(m: Any, age: int) -> tuple[float, float, float, Vec3, int, bool]:
    """Latitude, longitude, height, variance, age in ticks, valid."""
    c = m.position_covariance
    return m.latitude, m.longitude, m.altitude, (c[0], c[4], c[8]), age, m.status.status >= 0


def gps_velocity(m: Any, age: int) -> tuple[Vec3, float, int, bool]:
    """velocity_world, variance, age in ticks, valid."""
    variance = m.twist.covariance[0]
    return tuple(m.twist.twist.linear), variance, age, variance >= 0.0


def barometer(m: Any, age: int) -> tuple[float, float, bool]:
    """Pressure, variance, valid."""
    return m.fluid_pressure, m.variance, not math.isnan(m.fluid_pressure)


def sonar(m: Any, age: int) -> tuple[float, float, bool]:
    """Range (infinite without an echo), variance, valid."""
    return m.range, m.variance, not math.isnan(m.range)
