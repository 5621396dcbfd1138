"""Conversion of messages of PX4's simulator interface to readings of the ports: the inverse of `messages`.

The interface has no variances except the GPS accuracy, so the scene's sensors define them.
"""

from collections.abc import Mapping
from typing import Any

from lapwing.kernels import math
from lapwing.services.common import ports
from lapwing.services.common.mavlink.frames import swap_body, swap_world
from lapwing.services.px4.messages import (
    ACCELEROMETER,
    AIRSPEED,
    BAROMETER,
    DISTANCE_SENSOR,
    FIX_3D,
    GYRO,
    HIL_GPS,
    HIL_SENSOR,
    MAGNETOMETER,
    UNKNOWN,
)

PROVIDED = (ports.IMU, ports.MAGNETOMETER, ports.BAROMETER, ports.AIRSPEED, ports.GPS, ports.RANGEFINDER, ports.SONAR)
GAUSS, HECTO, CENTI = 1e-4, 100.0, 0.01


def readings(number: int, values: tuple, nominal: Mapping[str, Any]) -> dict[str, Any]:
    """Return the valid readings in a message by port.

    Args:
        number: message id.
        values: values of the message, in wire order.
        nominal: reading of each consumed port with the variances of its sensor.
    """
    result: dict[str, Any] = {}
    if number == HIL_SENSOR.number:
        result = _sensors(values)
    elif number == HIL_GPS.number and values[11] >= FIX_3D:
        result = {ports.GPS: _gps(values, nominal)}
    elif number == DISTANCE_SENSOR.number:
        distance = {"range": CENTI * values[3]}
        result = {ports.RANGEFINDER: distance, ports.SONAR: distance}
    return {port: nominal[port]._replace(**new, valid=True) for port, new in result.items() if port in nominal}


def _sensors(values: tuple) -> dict[str, dict[str, Any]]:
    """Return the fields of the readings that a HIL_SENSOR updates."""
    mask, result = values[14], {}
    if mask & ACCELEROMETER == ACCELEROMETER and mask & GYRO == GYRO:
        result[ports.IMU] = {"omega_body": swap_body(values[4:7]), "specific_force_body": swap_body(values[1:4])}
    if mask & MAGNETOMETER == MAGNETOMETER:
        north, east, down = values[7:10]
        result[ports.MAGNETOMETER] = {"field_body": swap_body((GAUSS * north, GAUSS * east, GAUSS * down))}
    if mask & BAROMETER == BAROMETER:
        result[ports.BAROMETER] = {"pressure": HECTO * values[10]}
    if mask & AIRSPEED == AIRSPEED:
        result[ports.AIRSPEED] = {"pressure": HECTO * values[11]}
    return result


def _gps(values: tuple, nominal: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a fix; the horizontal accuracy applies to east and north alike."""
    latitude, longitude, altitude, horizontal, vertical = values[1:6]
    default = nominal[ports.GPS].position_variance if ports.GPS in nominal else (0.0, 0.0, 0.0)
    east, _, up = default
    if horizontal != UNKNOWN:
        east = 0.5 * math.square(CENTI * horizontal)
    if vertical != UNKNOWN:
        up = math.square(CENTI * vertical)
    vn, ve, vd = values[7:10]
    return {
        "latitude_deg": 1e-7 * latitude,
        "longitude_deg": 1e-7 * longitude,
        "height": 1e-3 * altitude,
        "position_variance": (east, east, up),
        "velocity_world": swap_world((CENTI * vn, CENTI * ve, CENTI * vd)),
    }
