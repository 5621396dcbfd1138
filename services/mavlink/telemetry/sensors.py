"""Sensor readings; ideal ones if the vehicle flies on the true state."""

import math
from collections.abc import Sequence
from typing import Any

from lapwing.dynamics.constants import STANDARD_GRAVITY
from lapwing.messages import GPSStatus, NavSatStatus
from lapwing.messages.topics import BARO, GPS, GPS_DETAILS, GPS_VELOCITY, IMU, MAG
from lapwing.services.common.failure_types import FIX_SATELLITES
from lapwing.services.common.failure_types import SATELLITES as PARAMETER
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.frames import compass, saturate, swap_body
from lapwing.services.mavlink.px4_facts import SATELLITES
from lapwing.services.mavlink.telemetry.message_stream import stream
from lapwing.services.mavlink.vehicle_cache import VehicleCache

GAUSS, HECTOPASCAL, MILLI_G = 1e-4, 100.0, 1e-3 * STANDARD_GRAVITY
FIX_TYPES = {  # by the status of the receiver
    NavSatStatus.STATUS_FIX: mavlink.GPS_FIX_TYPE_3D_FIX,
    NavSatStatus.STATUS_SBAS_FIX: mavlink.GPS_FIX_TYPE_DGPS,
    NavSatStatus.STATUS_GBAS_FIX: mavlink.GPS_FIX_TYPE_RTK_FIXED,
}
DETAILED_FIX_TYPES = {
    GPSStatus.STATUS_FIX: mavlink.GPS_FIX_TYPE_3D_FIX,
    GPSStatus.STATUS_SBAS_FIX: mavlink.GPS_FIX_TYPE_DGPS,
    GPSStatus.STATUS_RTK_FLOAT: mavlink.GPS_FIX_TYPE_RTK_FLOAT,
    GPSStatus.STATUS_RTK_FIX: mavlink.GPS_FIX_TYPE_RTK_FIXED,
}
UNKNOWN_8, UNKNOWN_16 = 0xFF, 0xFFFF


def good_imu(v: VehicleCache) -> bool:
    """Return True if the newest reading is valid."""
    m = v.get(IMU)
    return m is not None and m.angular_velocity_covariance[0] >= 0.0


def good_mag(v: VehicleCache) -> bool:
    """Return True if the newest reading is valid."""
    m = v.get(MAG)
    return m is not None and math.isfinite(m.magnetic_field.x)


def good_baro(v: VehicleCache) -> bool:
    """Return True if the newest reading is valid."""
    m = v.get(BARO)
    return m is not None and math.isfinite(m.fluid_pressure)


def good_gps(v: VehicleCache) -> bool:
    """Return True if the receiver has a fix."""
    m = v.get(GPS)
    return m is not None and _satellites(v) >= FIX_SATELLITES and m.status.status >= NavSatStatus.STATUS_FIX


@stream("HIGHRES_IMU", 1.5, 50.0)
def highres_imu(v: VehicleCache) -> Any:
    """Return the inertial, magnetic and pressure readings; absent ones are 0 and not flagged."""
    if not good_imu(v):
        return None
    m = v.get(IMU)
    force, omega = swap_body(tuple(m.linear_acceleration)), swap_body(tuple(m.angular_velocity))
    field, pressure, updated = (0.0, 0.0, 0.0), 0.0, 0x3F
    if good_mag(v):
        x, y, z = swap_body(tuple(v.get(MAG).magnetic_field))
        field, updated = (x / GAUSS, y / GAUSS, z / GAUSS), updated | 0x1C0
    if good_baro(v):
        pressure, updated = v.get(BARO).fluid_pressure / HECTOPASCAL, updated | 0x200
    return mavlink.MAVLink_highres_imu_message(
        v.boot_us, *force, *omega, *field, pressure, 0.0, 0.0, v.description.air_temperature, updated
    )


@stream("SCALED_IMU")
def scaled_imu(v: VehicleCache) -> Any:
    """Return the inertial and magnetic readings as integers."""
    if not good_imu(v):
        return None
    m = v.get(IMU)
    force, omega = swap_body(tuple(m.linear_acceleration)), swap_body(tuple(m.angular_velocity))
    field = swap_body(tuple(v.get(MAG).magnetic_field)) if good_mag(v) else (0.0, 0.0, 0.0)
    return mavlink.MAVLink_scaled_imu_message(
        v.boot_ms,
        *[saturate(a / MILLI_G, 16) for a in force],
        *[saturate(1e3 * rate, 16) for rate in omega],
        *[saturate(1e3 * b / GAUSS, 16) for b in field],
    )


@stream("SCALED_PRESSURE", 1.0, 5.0)
def scaled_pressure(v: VehicleCache) -> Any:
    """Return the air pressure."""
    if not good_baro(v):
        return None
    pressure = v.get(BARO).fluid_pressure / HECTOPASCAL
    return mavlink.MAVLink_scaled_pressure_message(v.boot_ms, pressure, 0.0, round(1e2 * v.description.air_temperature))


@stream("GPS_RAW_INT", 5.0)
def gps_raw(v: VehicleCache) -> Any:
    """Return the receiver's fix; without a receiver, the estimated position."""
    if not v.description.sensors:
        return _estimated_fields(v)
    fix, twist = v.get(GPS), v.get(GPS_VELOCITY)
    if fix is None or twist is None:
        return None
    details = v.get(GPS_DETAILS)
    if not good_gps(v):
        used = _satellites(v)
        visible = details.status.satellites_visible if details else used if used < FIX_SATELLITES else 0
        return mavlink.MAVLink_gps_raw_int_message(
            v.boot_us, mavlink.GPS_FIX_TYPE_NO_FIX, 0, 0, 0, *(UNKNOWN_16,) * 4, visible
        )
    east, north, _ = twist.twist.twist.linear
    spread = math.sqrt(fix.position_covariance[0]), math.sqrt(fix.position_covariance[8])
    position = (fix.latitude, fix.longitude, fix.altitude)
    velocity = (north, east)
    if details is None or details.status.status not in DETAILED_FIX_TYPES:
        return _fix(v, FIX_TYPES[fix.status.status], position, velocity, spread, twist.twist.covariance[0])
    kind = DETAILED_FIX_TYPES[details.status.status]
    dilution = [saturate(100.0 * d, 16, unsigned=True) if d > 0.0 else UNKNOWN_16 for d in (details.hdop, details.vdop)]
    satellites = details.status.satellites_visible or UNKNOWN_8
    return _fix(v, kind, position, velocity, spread, twist.twist.covariance[0], dilution, satellites)


def _satellites(v: VehicleCache) -> int:
    """Return the number of satellites that SIM_GPS_USED selects."""
    value = v.parameter(PARAMETER)
    return SATELLITES if math.isnan(value) else int(value)


def _estimated_fields(v: VehicleCache) -> Any:
    if (m := v.estimate) is None:
        return None
    return _fix(v, mavlink.GPS_FIX_TYPE_3D_FIX, m.geodetic, m.velocity_ned[:2], (0.0, 0.0), 0.0)


def _fix(
    v: VehicleCache,
    fix_type: int,
    position: Any,
    velocity: Any,
    spread: tuple[float, float],
    speed_variance: float,
    dilution: Sequence[int] = (100, 100),  # dilutions of precision, in hundredths
    satellites: int | None = None,
) -> Any:
    latitude, longitude, altitude = position
    north, east = velocity
    height = saturate(altitude * 1e3, 32)
    return mavlink.MAVLink_gps_raw_int_message(
        v.boot_us,
        fix_type,
        saturate(latitude * 1e7, 32),
        saturate(longitude * 1e7, 32),
        height,
        *dilution,
        saturate(100.0 * math.hypot(north, east), 16, unsigned=True),
        compass(math.atan2(east, north)),
        _satellites(v) if satellites is None else satellites,
        height,
        *[saturate(1e3 * s, 32, unsigned=True) for s in spread],
        saturate(1e3 * math.sqrt(max(0.0, speed_variance)), 32, unsigned=True),
    )


@stream("VIBRATION", 0.5, 0.5)
def vibration(v: VehicleCache) -> Any:
    """Return zero vibration: it is not modelled, but displays expect the message."""
    return mavlink.MAVLink_vibration_message(v.boot_us, 0.0, 0.0, 0.0, 0, 0, 0)
