"""Fields of a MISSION_ITEM_INT, and the table of functions that convert items."""

import math
from collections.abc import Callable
from typing import Any

from lapwing.messages import MissionItem, Vector3
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.frames import swap_yaw
from lapwing.services.common.mavlink.geo_coordinates import ABOVE_HOME, ABOVE_SEA, Datum, degrees, to_world

_ON_GLOBE = ABOVE_SEA | ABOVE_HOME


class RejectedItemError(ValueError):
    """Item that cannot be flown; `result` is the MAV_MISSION_RESULT."""

    def __init__(self, result: int, item: int = 0):
        super().__init__(f"item {item}: {mavlink.enums['MAV_MISSION_RESULT'][result].name}")
        self.result = result


Converter = Callable[[Any, Datum], Any]

CONVERTERS: dict[int, Converter] = {}
"""Conversion function by MAV_CMD."""


def converts(*commands: int) -> Callable[[Converter], Converter]:
    """Declare the function that converts items with these commands."""

    def declare(function: Converter) -> Converter:
        CONVERTERS.update(dict.fromkeys(commands, function))
        return function

    return declare


def idle() -> Any:
    """Return an item without effect or duration."""
    return MissionItem("delay", Vector3(), math.nan, math.nan, 0.0, ())


def position(m: Any, datum: Datum, required: bool = True) -> Any:
    """Return the position of an item; NaN if it is optional and not specified."""
    if m.frame not in _ON_GLOBE:
        raise RejectedItemError(mavlink.MAV_MISSION_UNSUPPORTED_FRAME, m.seq)
    latitude, longitude = degrees(m.x), degrees(m.y)
    if not required and (m.x, m.y) == (0, 0):
        latitude = longitude = math.nan
    for value, limit, result in (
        (latitude, 90.0, mavlink.MAV_MISSION_INVALID_PARAM5_X),
        (longitude, 180.0, mavlink.MAV_MISSION_INVALID_PARAM6_Y),
        (m.z, 1e5, mavlink.MAV_MISSION_INVALID_PARAM7),
    ):
        if abs(value) > limit or (required and math.isnan(value)):
            raise RejectedItemError(result, m.seq)
    return Vector3(*to_world(datum, m.frame, latitude, longitude, m.z))


def non_negative(value: float, result: int, m: Any) -> float:
    """Return a time or number that must not be negative; 0 if it is not specified."""
    if value < 0.0:
        raise RejectedItemError(result, m.seq)
    return 0.0 if math.isnan(value) else value


def radius(value: float) -> float:
    """Return the acceptance radius [m]; NaN, for the autopilot's default, if it is not specified."""
    return value if value > 0.0 else math.nan


def yaw(value: float) -> float:
    """Return the world yaw [rad] of a heading [deg]."""
    return swap_yaw(math.radians(value))
