"""Telemetry of the nearest obstacles around the vehicle, from a scanning lidar."""

import math
from typing import Any

import numpy as np

from lapwing.messages.topics import LASER_SCAN, POINT_CLOUD
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.telemetry.message_stream import stream
from lapwing.services.mavlink.vehicle_cache import VehicleCache

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
