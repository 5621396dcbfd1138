"""Telemetry of distance sensors, obstacles, optical flow and airspeed."""

import math
from typing import Any

import numpy as np

from lapwing.messages.topics import (
    AIRSPEED,
    AIRSPEED_RECEIVED,
    LASER_SCAN,
    OPTICAL_FLOW,
    POINT_CLOUD,
    RANGEFINDER,
    SONAR,
)
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.frames import Quaternion, from_euler, saturate
from lapwing.services.mavlink.px4_facts import PRESSURE_OFFSET
from lapwing.services.mavlink.telemetry.message_stream import stream
from lapwing.services.mavlink.vehicle_cache import VehicleCache

CENTIMETRE = 0.01
SONAR_ID, RANGEFINDER_ID = 0, 1
SEA_LEVEL_DENSITY = 1.225  # [kg/m^3] reference of indicated airspeed
EIGHTH = 45.0  # [deg] between two of MAV_SENSOR_ROTATION's headings
QUALITY = 255  # quality of a measured flow
NO_ROTATION = (0.0, 0.0, 0.0, 0.0)  # for a named orientation
DOWN = (mavlink.MAV_SENSOR_ROTATION_PITCH_270, NO_ROTATION)


def good_distance(v: VehicleCache) -> bool:
    """Return True if every distance sensor has a reading."""
    readings = [v.get(topic) for topic in (SONAR, RANGEFINDER)]
    return any(readings) and not any(math.isnan(m.range) for m in readings if m)


def good_flow(v: VehicleCache) -> bool:
    """Return True if the camera measures the flow."""
    m = v.get(OPTICAL_FLOW)
    return m is not None and math.isfinite(m.flow[0])


def _airspeed(v: VehicleCache) -> Any:
    """Return the reading that the autopilot received; without an operator, that of the sensor."""
    return v.get(AIRSPEED_RECEIVED) or v.get(AIRSPEED)


def good_airspeed(v: VehicleCache) -> bool:
    """Return True if the newest reading is valid."""
    m = _airspeed(v)
    return m is not None and math.isfinite(m.fluid_pressure)


def indicated_airspeed(v: VehicleCache) -> float | None:
    """Return the airspeed [m/s] along the tube at sea-level density. Return None without a reading."""
    if not good_airspeed(v):
        return None
    offset = v.parameter(PRESSURE_OFFSET)
    pressure = _airspeed(v).fluid_pressure - (0.0 if math.isnan(offset) else offset)  # NaN: not of this firmware
    return math.sqrt(max(0.0, 2.0 * pressure / SEA_LEVEL_DENSITY))


def orientation(azimuth_deg: float, elevation_deg: float) -> tuple[int, Quaternion]:
    """Return the MAV_SENSOR_ORIENTATION of a ray, and for a custom one the rotation in FRD from x to the ray.

    Args:
        azimuth_deg: from body x direction y (left).
        elevation_deg: above the body's xy plane.
    """
    if abs(elevation_deg) == 90.0:
        return (mavlink.MAV_SENSOR_ROTATION_PITCH_90, NO_ROTATION) if elevation_deg > 0.0 else DOWN
    if elevation_deg == 0.0 and azimuth_deg % EIGHTH == 0.0:
        return round(-azimuth_deg / EIGHTH) % 8, NO_ROTATION  # YAW_45 and so on, clockwise from above
    turn = from_euler(0.0, math.radians(elevation_deg), math.radians(-azimuth_deg))
    return mavlink.MAV_SENSOR_ROTATION_CUSTOM, turn


@stream("DISTANCE_SENSOR", 5.0, 10.0)
def distance_sensors(v: VehicleCache) -> Any:
    """Return the distance of each sensor; out of range reads just above the maximum."""
    messages = []
    if (sonar := v.get(SONAR)) is not None:
        messages.append(_distance(v, sonar, SONAR_ID, mavlink.MAV_DISTANCE_SENSOR_ULTRASOUND, DOWN))
    if (laser := v.get(RANGEFINDER)) is not None:
        direction = orientation(*v.description.ray_deg)
        messages.append(_distance(v, laser, RANGEFINDER_ID, mavlink.MAV_DISTANCE_SENSOR_LASER, direction))
    return [message for message in messages if message is not None]


def _distance(v: VehicleCache, m: Any, number: int, kind: int, direction: tuple[int, Quaternion]) -> Any:
    if math.isnan(m.range):
        return None
    minimum, maximum = (saturate(metres / CENTIMETRE, 16, unsigned=True) for metres in (m.min_range, m.max_range))
    distance = maximum + 1 if m.range == math.inf else 0 if m.range == -math.inf else round(m.range / CENTIMETRE)
    return mavlink.MAVLink_distance_sensor_message(
        v.boot_ms,
        minimum,
        maximum,
        min(distance, 0xFFFF),
        kind,
        number,
        direction[0],
        saturate(m.variance / CENTIMETRE**2, 8, unsigned=True),
        m.field_of_view,
        m.field_of_view,
        list(direction[1]),
    )


@stream("OPTICAL_FLOW_RAD", 1.0, 10.0)
def optical_flow(v: VehicleCache) -> Any:
    """Return the flow integrated over one period; quality 0 without texture."""
    m = v.get(OPTICAL_FLOW)
    if m is None:
        return None
    interval, is_good = v.description.flow_interval, good_flow(v)
    flow_x, flow_y = m.flow if is_good else (0.0, 0.0)
    turn_x, turn_y = m.rate
    return mavlink.MAVLink_optical_flow_rad_message(
        v.boot_us,
        0,
        round(1e6 * interval),
        interval * flow_x,  # about FRD's x, and about its y, which is opposite to FLU's
        -interval * flow_y,
        interval * turn_x,
        -interval * turn_y,
        0.0,  # no gyroscope about z
        0,
        QUALITY if is_good else 0,
        0,
        m.distance if is_good else -1.0,
    )


SECTORS = 72
WIDTH_DEG = 360.0 / SECTORS
UNKNOWN = 0xFFFF
FARTHEST = 0xFFFF - 2  # [cm] that a sector can hold, with one above it for a free sector
LEVEL_DEG = 2.5  # [deg] elevation up to which a point of a cloud is an obstacle ahead, not the ground


def sector_distances(azimuth: np.ndarray, distance: np.ndarray, most: float) -> list[int]:
    """Return the smallest distance [cm] of each sector, clockwise from ahead; one above `most` where it is free.

    Args:
        azimuth: (n,) [rad] from body x towards y (left).
        distance: (n,) [m], inf or NaN without a return.
        most: maximum range [m].
    """
    sector = np.round(-np.degrees(azimuth) / WIDTH_DEG).astype(int) % SECTORS
    nearest = np.full(SECTORS, np.inf)
    np.minimum.at(nearest, sector, np.where(np.isnan(distance), np.inf, np.maximum(distance, 0.0)))
    limit = min(round(100.0 * most), FARTHEST)
    centimetres = np.where(np.isfinite(nearest), np.minimum(np.round(100.0 * nearest), limit), limit + 1)
    is_known = np.zeros(SECTORS, bool)
    is_known[sector] = True
    return [int(value) for value in np.where(is_known, centimetres, UNKNOWN)]


@stream("OBSTACLE_DISTANCE", 1.0, 10.0)
def obstacle_distance(v: VehicleCache) -> Any:
    """Return the nearest obstacle in each of 72 sectors of the body's horizontal plane."""
    if (scan := v.get(LASER_SCAN)) is not None:
        distance = np.asarray(scan.ranges)
        azimuth, least, most = (
            scan.angle_min + scan.angle_increment * np.arange(len(distance)),
            scan.range_min,
            scan.range_max,
        )
        distance = np.where(distance == -math.inf, least, distance)
    elif (cloud := v.get(POINT_CLOUD)) is not None:
        x, y, z = np.frombuffer(bytes(cloud.data), "<f4").reshape(-1, 3).T
        across = np.hypot(x, y)
        ahead = np.abs(np.degrees(np.arctan2(z, across))) <= LEVEL_DEG
        azimuth, distance, least, most = np.arctan2(y, x)[ahead], across[ahead], 0.0, 0.01 * FARTHEST
    else:
        return None
    result = sector_distances(azimuth, distance, most)
    limit = min(round(100.0 * most), FARTHEST)
    return mavlink.MAVLink_obstacle_distance_message(
        v.boot_us, mavlink.MAV_DISTANCE_SENSOR_LASER, result, 0, round(100.0 * least), limit, WIDTH_DEG, 0.0,
        mavlink.MAV_FRAME_BODY_FRD,
    )  # fmt: skip
