"""Places as clients write them, in the world frame."""

import math

from dynamics.geodesy import enu_to_geodetic, geodetic_to_enu
from dynamics.vector import Vec3
from services.mavlink.dialect import mavlink
from services.mavlink.view import HOME

NOWHERE = 0x7FFFFFFF  # a coordinate that is not given, in messages of whole numbers

ABOVE_SEA = {mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT}
ABOVE_HOME = {mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT}


def degrees(coordinate: int) -> float:
    """Latitude or longitude [deg] of a whole number [1e-7 deg], NaN where it is not given."""
    return math.nan if coordinate == NOWHERE else coordinate * 1e-7


def to_world(frame: int, latitude: float, longitude: float, altitude: float) -> Vec3:
    """World-frame position [m]; what is not given (NaN) stays so.

    Args:
        frame: a MAV_FRAME on the globe; says what the altitude counts from.
        latitude: [deg].
        longitude: [deg].
        altitude: [m].

    Raises:
        ValueError: a frame that is none on the globe, or a place that is none on Earth.
    """
    if frame not in ABOVE_SEA | ABOVE_HOME:
        raise ValueError(f"frame {frame}")
    if abs(latitude) > 90.0 or abs(longitude) > 180.0 or abs(altitude) > 1e5:  # NaN passes
        raise ValueError(f"no place on Earth: {latitude}, {longitude}, {altitude}")
    height = altitude + (HOME.height if frame in ABOVE_HOME else 0.0)
    if math.isnan(latitude) or math.isnan(longitude):
        return math.nan, math.nan, height - HOME.height
    if math.isnan(altitude):
        east, north, _ = geodetic_to_enu(HOME, latitude, longitude, HOME.height)
        return east, north, math.nan
    return geodetic_to_enu(HOME, latitude, longitude, height)


def prepare() -> None:
    """Load the compiled conversions, so that the first message does not wait for them."""
    enu_to_geodetic(HOME, geodetic_to_enu(HOME, *HOME))
