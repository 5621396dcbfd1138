"""Conversion of geodetic coordinates of MAVLink messages to and from the world frame."""

import math
from typing import NamedTuple

from lapwing.dynamics import geodesy
from lapwing.dynamics.geodesy import Home
from lapwing.dynamics.vector import Vec3
from lapwing.kernels import python_function

enu_to_geodetic = python_function(geodesy.enu_to_geodetic)  # the link's process has no compiled code
geodetic_to_enu = python_function(geodesy.geodetic_to_enu)

UNSPECIFIED = 0x7FFFFFFF  # unspecified coordinate of integer messages

# MAV_FRAME; as numbers, because every command imports this module and few need MAVLink's messages
ABOVE_SEA = {0, 5}  # GLOBAL, GLOBAL_INT
ABOVE_HOME = {3, 6}  # GLOBAL_RELATIVE_ALT, GLOBAL_RELATIVE_ALT_INT


class Datum(NamedTuple):
    """Reference of geographic coordinates and altitudes."""

    home: Home = Home()  # origin of the world frame
    home_z: float = 0.0  # [m] world z of relative altitude 0
    standing_height: float = 0.0  # [m] of the body frame's origin above the ground


def to_local(standing_height: float, position_world: Vec3) -> Vec3:
    """Convert a world position to NED [m] from the local origin: the body frame's origin at the start.

    Args:
        standing_height: height of the body frame's origin above the ground at the start [m].
        position_world: world position [m].
    """
    x, y, z = position_world
    return y, x, standing_height - z


def from_local(standing_height: float, position_ned: Vec3) -> Vec3:
    """Convert NED [m] from the local origin to a world position [m]; inverse of `to_local`."""
    north, east, down = position_ned
    return east, north, standing_height - down


def degrees(coordinate: int) -> float:
    """Convert a latitude or longitude from 1e-7 deg to deg; NaN if it is not specified."""
    return math.nan if coordinate == UNSPECIFIED else coordinate * 1e-7


def to_world(datum: Datum, frame: int, latitude: float, longitude: float, altitude: float) -> Vec3:
    """Convert geographic coordinates to a world position [m]; unspecified (NaN) coordinates stay NaN.

    Args:
        datum: reference.
        frame: global MAV_FRAME; defines the reference of the altitude.
        latitude: [deg].
        longitude: [deg].
        altitude: [m].

    Raises:
        ValueError: the frame is not global, or a coordinate is out of range.
    """
    if frame not in ABOVE_SEA | ABOVE_HOME:
        raise ValueError(f"frame {frame}")
    if abs(latitude) > 90.0 or abs(longitude) > 180.0 or abs(altitude) > 1e5:  # NaN passes
        raise ValueError(f"not a position on Earth: {latitude}, {longitude}, {altitude}")
    home = datum.home
    height = altitude + (home.height + datum.home_z if frame in ABOVE_HOME else 0.0)
    if math.isnan(latitude) or math.isnan(longitude):
        return math.nan, math.nan, height - home.height
    if math.isnan(altitude):
        east, north, _ = geodetic_to_enu(home, latitude, longitude, home.height)
        return east, north, math.nan
    return geodetic_to_enu(home, latitude, longitude, height)


def from_world(datum: Datum, position_world: Vec3) -> Vec3:
    """Return latitude [deg], longitude [deg] and altitude above home [m] of a world position [m]."""
    latitude, longitude, height = enu_to_geodetic(datum.home, position_world)
    return latitude, longitude, height - datum.home.height - datum.home_z
