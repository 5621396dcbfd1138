"""Places on the Earth as MAVLink messages give them, to and from the world frame."""

import math
from typing import NamedTuple

from lapwing.dynamics import geodesy
from lapwing.dynamics.geodesy import Home
from lapwing.dynamics.vector import Vec3
from lapwing.kernels import python_function
from lapwing.services.mavlink.dialect import mavlink

enu_to_geodetic = python_function(geodesy.enu_to_geodetic)  # the link's process runs nothing compiled
geodetic_to_enu = python_function(geodesy.geodetic_to_enu)

NOT_GIVEN = 0x7FFFFFFF  # a coordinate that is not given, in messages of whole numbers

ABOVE_SEA = {mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT}
ABOVE_HOME = {mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT}


class Datum(NamedTuple):
    """What places on the Earth count from."""

    home: Home = Home()  # origin of the world frame
    home_z: float = 0.0  # [m] world z from which relative altitudes count
    standing_height: float = 0.0  # [m] of the body frame's origin above the ground


def to_local(standing_height: float, position_world: Vec3) -> Vec3:
    """North, east, down [m] of the local origin: the body frame's origin of a vehicle that stands where it starts.

    Args:
        standing_height: [m] of the body frame's origin above the ground there.
        position_world: [m].
    """
    x, y, z = position_world
    return y, x, standing_height - z


def from_local(standing_height: float, position_ned: Vec3) -> Vec3:
    """Position [m] in the world frame of one from the local origin in NED [m]; inverse of `to_local`."""
    north, east, down = position_ned
    return east, north, standing_height - down


def degrees(coordinate: int) -> float:
    """Latitude or longitude [deg] of a whole number [1e-7 deg], NaN where it is not given."""
    return math.nan if coordinate == NOT_GIVEN else coordinate * 1e-7


def to_world(datum: Datum, frame: int, latitude: float, longitude: float, altitude: float) -> Vec3:
    """World-frame position [m]; what is not given (NaN) stays so.

    Args:
        datum: what it counts from.
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
    home = datum.home
    height = altitude + (home.height + datum.home_z if frame in ABOVE_HOME else 0.0)
    if math.isnan(latitude) or math.isnan(longitude):
        return math.nan, math.nan, height - home.height
    if math.isnan(altitude):
        east, north, _ = geodetic_to_enu(home, latitude, longitude, home.height)
        return east, north, math.nan
    return geodetic_to_enu(home, latitude, longitude, height)


def from_world(datum: Datum, position_world: Vec3) -> Vec3:
    """Latitude [deg], longitude [deg] and altitude above home [m] of a world-frame position [m]."""
    latitude, longitude, height = enu_to_geodetic(datum.home, position_world)
    return latitude, longitude, height - datum.home.height - datum.home_z
