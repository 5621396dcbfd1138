"""Fields of a MISSION_ITEM_INT, and the table of what is made of each command."""

import math
from collections.abc import Callable
from typing import Any

from lapwing.messages import MissionItem, Vector3
from lapwing.services.mavlink.dialect import mavlink
from lapwing.services.mavlink.frames import swap_yaw
from lapwing.services.mavlink.geo_coordinates import ABOVE_HOME, ABOVE_SEA, Datum, degrees, to_world

_ON_GLOBE = ABOVE_SEA | ABOVE_HOME


class RefusedItemError(ValueError):
    """An item that cannot be flown; `result` is the MAV_MISSION_RESULT."""

    def __init__(self, result: int, item: int = 0):
        super().__init__(f"item {item}: {mavlink.enums['MAV_MISSION_RESULT'][result].name}")
        self.result = result


Maker = Callable[[Any, Datum], Any]

MAKERS: dict[int, Maker] = {}
"""By MAV_CMD."""


def makes(*commands: int) -> Callable[[Maker], Maker]:
    """Declare what is made of these commands."""

    def declare(function: Maker) -> Maker:
        MAKERS.update(dict.fromkeys(commands, function))
        return function

    return declare


def idle() -> Any:
    """An item that does nothing and takes no time."""
    return MissionItem("delay", Vector3(), math.nan, math.nan, 0.0, ())


def place(m: Any, datum: Datum, needed: bool = True) -> Any:
    """Position of an item; where it need not say and does not, NaN."""
    if m.frame not in _ON_GLOBE:
        raise RefusedItemError(mavlink.MAV_MISSION_UNSUPPORTED_FRAME, m.seq)
    latitude, longitude = degrees(m.x), degrees(m.y)
    if not needed and (m.x, m.y) == (0, 0):
        latitude = longitude = math.nan
    for value, limit, result in (
        (latitude, 90.0, mavlink.MAV_MISSION_INVALID_PARAM5_X),
        (longitude, 180.0, mavlink.MAV_MISSION_INVALID_PARAM6_Y),
        (m.z, 1e5, mavlink.MAV_MISSION_INVALID_PARAM7),
    ):
        if abs(value) > limit or (needed and math.isnan(value)):
            raise RefusedItemError(result, m.seq)
    return Vector3(*to_world(datum, m.frame, latitude, longitude, m.z))


def length(value: float, result: int, m: Any) -> float:
    """A time or a number that must not be negative; one that is not given is 0."""
    if value < 0.0:
        raise RefusedItemError(result, m.seq)
    return 0.0 if math.isnan(value) else value


def radius(value: float) -> float:
    """Acceptance radius [m]; NaN, for the autopilot's own, where none is given."""
    return value if value > 0.0 else math.nan


def yaw(value: float) -> float:
    """World yaw [rad] of a heading [deg]."""
    return swap_yaw(math.radians(value))
