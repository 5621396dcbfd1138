"""Topic encoders of the sensors. Lost readings are published by the convention of each message type, never omitted."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.topic_encoder import Fields, TopicEncoder
from lapwing.kernels import math
from lapwing.messages import (
    FluidPressure,
    GPSFix,
    GPSStatus,
    Imu,
    MagneticField,
    NavSatFix,
    NavSatStatus,
    Range,
    TwistWithCovarianceStamped,
    header,
)
from lapwing.messages import topics as topic
from lapwing.messages.cdr_arrays import stamp_columns
from lapwing.services.common import ports
from lapwing.services.common.encoders import pressure_columns
from lapwing.services.common.ports import DistanceReading, GpsReading, ImuReading, MagnetometerReading

# by `GpsReading.fix`
_NAV_SAT = np.array([0, *(getattr(NavSatStatus, f"STATUS_{name}FIX") for name in ("", "SBAS_", "GBAS_", "GBAS_"))])
_GPS_STATUS = np.array(
    [0, *(getattr(GPSStatus, f"STATUS_{name}") for name in ("FIX", "SBAS_FIX", "RTK_FLOAT", "RTK_FIX"))]
)
_NORMAL_95 = 1.959964  # standard deviations

UNKNOWN = -1.0  # first element of the covariance of a missing measurement


# Other sensors have their own encoders.
PORTS = (ports.IMU, ports.MAGNETOMETER, ports.GPS, ports.BAROMETER, ports.SONAR)


def topic_encoders(config: RunConfig, sensors: Mapping[str, Any]) -> list[TopicEncoder]:
    """Return the encoders of the vehicle's sensors in `PORTS`; `sensors` has the parameters of each by name."""
    frame, port_of = config.vehicle, config.ports
    gps, sonar = sensors.get(ports.GPS), sensors.get(ports.SONAR)
    fix = gps.fix_status if gps else NavSatStatus.STATUS_FIX
    detailed = gps is not None and (gps.constellation is not None or gps.rtk is not None)
    known: list[tuple[Any, str, Callable, Any]] = [
        (topic.IMU, ports.IMU, _imu, Imu(header(0, frame), orientation_covariance=(UNKNOWN,) + (0.0,) * 8)),
        (topic.MAG, ports.MAGNETOMETER, _magnetometer, MagneticField(header(0, frame))),
        (topic.GPS, ports.GPS, partial(_gps, fix), _gps_sample(frame)),
        (topic.GPS_VELOCITY, ports.GPS, _gps_velocity, TwistWithCovarianceStamped(header(0, "world"))),
        *([(topic.GPS_DETAILS, ports.GPS, _gps_details, _details_sample(frame))] if detailed else []),
        (topic.BARO, ports.BAROMETER, pressure_columns, FluidPressure(header(0, frame))),
        (topic.SONAR, ports.SONAR, _sonar, _sonar_sample(frame, sonar)),
    ]
    return [
        TopicEncoder(name, port, port_of[port].period, fields, lambda sample=sample: sample)  # type: ignore[misc]
        for name, port, fields, sample in known
        if port in port_of
    ]


def diagonal(values: np.ndarray, size: int = 3) -> np.ndarray:
    """Return row-major covariances, shape (n, size^2), with diagonals `values`, shape (n, 3)."""
    result = np.zeros((len(values), size * size))
    for i in range(3):
        result[:, i * (size + 1)] = values[:, i]
    return result


def _three(values: np.ndarray) -> np.ndarray:
    return np.repeat(np.asarray(values)[:, None], 3, axis=1)


def _imu(r: ImuReading, time_ns: np.ndarray) -> Fields:
    """Return rates and specific force in the body frame; without a reading, both covariances start with -1."""
    valid = np.asarray(r.valid) != 0.0
    omega, force = diagonal(_three(r.omega_variance)), diagonal(_three(r.specific_force_variance))  # type: ignore[arg-type]
    omega[~valid] = force[~valid] = (UNKNOWN,) + (0.0,) * 8
    return {
        **stamp_columns(time_ns),
        "angular_velocity": r.omega_body,
        "angular_velocity_covariance": omega,
        "linear_acceleration": r.specific_force_body,
        "linear_acceleration_covariance": force,
    }


def _magnetometer(r: MagnetometerReading, time_ns: np.ndarray) -> Fields:
    """Return the field in the body frame; NaN without a reading."""
    valid = (np.asarray(r.valid) != 0.0)[:, None]
    return {
        **stamp_columns(time_ns),
        "magnetic_field": np.where(valid, r.field_body, math.nan),
        "magnetic_field_covariance": diagonal(_three(r.variance)),  # type: ignore[arg-type]
    }


def _fix_times(r: GpsReading, time_ns: np.ndarray) -> np.ndarray:
    """Return the times [ns] for which the fixes are valid."""
    # fixes from before the start are stamped with the start: the vehicle was at rest
    return np.maximum(time_ns - np.round(np.asarray(r.age) * 1e9).astype(np.int64), 0)


def _gps_sample(frame: str) -> Any:
    return NavSatFix(
        header(0, frame),
        NavSatStatus(NavSatStatus.STATUS_NO_FIX, NavSatStatus.SERVICE_GPS),
        position_covariance_type=NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN,
    )


def _gps(fix: int, r: GpsReading, time_ns: np.ndarray) -> Fields:
    """Return a fix, stamped with the time for which it is valid; without a reading, no fix."""
    valid, kind = np.asarray(r.valid) != 0.0, np.asarray(r.fix).astype(int)
    return {
        **stamp_columns(_fix_times(r, time_ns)),
        "status.status": np.where(valid, _NAV_SAT[kind] + (kind == 0) * fix, NavSatStatus.STATUS_NO_FIX),
        "latitude": r.latitude_deg,
        "longitude": r.longitude_deg,
        "altitude": r.height,
        "position_covariance": diagonal(np.asarray(r.position_variance)),
    }


def _details_sample(frame: str) -> Any:
    return GPSFix(
        header(0, frame),
        GPSStatus(header(0, frame), status=GPSStatus.STATUS_NO_FIX, position_source=GPSStatus.SOURCE_GPS),
        position_covariance_type=GPSFix.COVARIANCE_TYPE_DIAGONAL_KNOWN,
    )


def _gps_details(r: GpsReading, time_ns: np.ndarray) -> Fields:
    """Return kind of fix, satellites, dilution of precision and motion; uncertainties are those of 95 % probability."""
    valid, kind = np.asarray(r.valid) != 0.0, np.asarray(r.fix).astype(int)
    velocity, variance = np.asarray(r.velocity_world), np.asarray(r.position_variance)
    hdop, vdop = np.asarray(r.hdop), np.asarray(r.vdop)
    stamp = stamp_columns(_fix_times(r, time_ns))
    return {
        **stamp,
        **{f"status.{name}": value for name, value in stamp.items()},
        "status.status": np.where(valid, _GPS_STATUS[kind], GPSStatus.STATUS_NO_FIX),
        "status.satellites_used": r.used,
        "status.satellites_visible": r.visible,
        "latitude": r.latitude_deg,
        "longitude": r.longitude_deg,
        "altitude": r.height,
        "track": np.array([math.degrees(math.atan2(east, north)) % 360.0 for east, north, _ in velocity]),
        "speed": np.sqrt(np.square(velocity[:, :2]).sum(axis=1)),
        "climb": velocity[:, 2],
        "pdop": np.sqrt(hdop * hdop + vdop * vdop),
        "hdop": hdop,
        "vdop": vdop,
        "err_horz": _NORMAL_95 * np.sqrt(variance[:, 0] + variance[:, 1]),
        "err_vert": _NORMAL_95 * np.sqrt(variance[:, 2]),
        "position_covariance": diagonal(variance),
    }


def _gps_velocity(r: GpsReading, time_ns: np.ndarray) -> Fields:
    """Return the velocity in the world frame; without a reading, the covariance starts with -1."""
    valid = np.asarray(r.valid) != 0.0
    return {
        **stamp_columns(_fix_times(r, time_ns)),
        "twist.twist.linear": r.velocity_world,
        "twist.covariance": diagonal(_three(np.where(valid, r.velocity_variance, UNKNOWN)), size=6),
    }


def _sonar_sample(frame: str, sonar: Any) -> Any:
    view, least, most = 0.0, 0.0, 0.0
    if sonar is not None:
        view, least, most = math.radians(2.0 * sonar.half_beam_deg), sonar.range_min, sonar.range_max
    return Range(header(0, frame), radiation_type=Range.ULTRASOUND, field_of_view=view, min_range=least, max_range=most)


def _sonar(r: DistanceReading, time_ns: np.ndarray) -> Fields:
    """Return the downward distance; +Inf without an echo, -Inf below the minimum, NaN without a reading."""
    return {
        **stamp_columns(time_ns),
        "range": np.where(np.asarray(r.valid) != 0.0, r.range, math.nan),
        "variance": r.variance,
    }
