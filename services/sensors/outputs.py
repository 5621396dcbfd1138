"""Readings as messages. A reading that is not there is said in each type's own way, never by silence."""

import math
from typing import Any

from messages import (
    FluidPressure,
    Imu,
    MagneticField,
    NavSatFix,
    NavSatStatus,
    Range,
    Twist,
    TwistWithCovariance,
    TwistWithCovarianceStamped,
    Vector3,
    header,
)
from messages.topics import BARO, GPS, GPS_VELOCITY, IMU, MAG, SONAR

UNKNOWN = -1.0  # first element of a covariance: there is no such measurement
NO_ORIENTATION = (UNKNOWN,) + (0.0,) * 8


def diagonal(x: float, y: float, z: float) -> tuple[float, ...]:
    """A 3x3 covariance in row order."""
    return (x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z)


def imu(time_ns: int, frame: str, p: Any, r: Any) -> Any:
    """Rates and specific force in the body frame; no reading: both covariances begin with -1."""
    omega = diagonal(*(r.omega_variance,) * 3) if r.valid else NO_ORIENTATION
    force = diagonal(*(r.specific_force_variance,) * 3) if r.valid else NO_ORIENTATION
    return Imu(
        header(time_ns, frame),
        orientation_covariance=NO_ORIENTATION,
        angular_velocity=Vector3(*r.omega_body),
        angular_velocity_covariance=omega,
        linear_acceleration=Vector3(*r.specific_force_body),
        linear_acceleration_covariance=force,
    )


def magnetometer(time_ns: int, frame: str, p: Any, r: Any) -> Any:
    """Field in the body frame; no reading: NaN."""
    field = r.field_body if r.valid else (math.nan,) * 3
    return MagneticField(header(time_ns, frame), Vector3(*field), diagonal(*(r.variance,) * 3))


def gps(time_ns: int, frame: str, p: Any, r: Any) -> Any:
    """A fix, stamped with the time that it is valid for; no reading: no fix."""
    status = NavSatStatus.STATUS_GBAS_FIX if r.valid else NavSatStatus.STATUS_NO_FIX
    return NavSatFix(
        header(time_ns - round(r.age * 1e9), frame),
        NavSatStatus(status, NavSatStatus.SERVICE_GPS),
        r.latitude_deg,
        r.longitude_deg,
        r.height,
        diagonal(*r.position_variance),
        NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN,
    )


def gps_velocity(time_ns: int, frame: str, p: Any, r: Any) -> Any:
    """Velocity in the world frame; no reading: the covariance begins with -1."""
    variance = r.velocity_variance if r.valid else UNKNOWN
    covariance = [0.0] * 36
    covariance[0] = covariance[7] = covariance[14] = variance
    twist = TwistWithCovariance(Twist(Vector3(*r.velocity_world), Vector3()), tuple(covariance))
    return TwistWithCovarianceStamped(header(time_ns - round(r.age * 1e9), "world"), twist)


def barometer(time_ns: int, frame: str, p: Any, r: Any) -> Any:
    """Absolute pressure; no reading: NaN."""
    return FluidPressure(header(time_ns, frame), r.pressure if r.valid else math.nan, r.variance)


def sonar(time_ns: int, frame: str, p: Any, r: Any) -> Any:
    """Distance downwards; no echo +Inf, too near -Inf, no reading NaN."""
    return Range(
        header(time_ns, frame),
        radiation_type=Range.ULTRASOUND,
        field_of_view=math.radians(2.0 * p.half_beam_deg),
        min_range=p.range_min,
        max_range=p.range_max,
        range=r.range if r.valid else math.nan,
        variance=r.variance,
    )


CONVERSIONS = {
    "imu": ((IMU, imu),),
    "magnetometer": ((MAG, magnetometer),),
    "gps": ((GPS, gps), (GPS_VELOCITY, gps_velocity)),
    "barometer": ((BARO, barometer),),
    "sonar": ((SONAR, sonar),),
}
