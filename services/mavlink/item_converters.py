"""Conversion of mission, fence and rally-point commands (MISSION_ITEM_INT) into the autopilot's items."""

import math
from collections.abc import Callable
from typing import Any

from lapwing.messages import MissionItem, Vector3
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.frames import swap_yaw
from lapwing.services.common.mavlink.geo_coordinates import ABOVE_HOME, ABOVE_SEA, Datum, degrees, to_world

MAX_ITEMS = 1000
_GLOBAL = ABOVE_SEA | ABOVE_HOME
_ORIGIN, _UNSET = Vector3(), Vector3(math.nan, math.nan, math.nan)


class RejectedItemError(ValueError):
    """Item that cannot be flown; `result` is the MAV_MISSION_RESULT."""

    def __init__(self, result: int, item: int = 0):
        super().__init__(f"item {item}: {mavlink.enums['MAV_MISSION_RESULT'][result].name}")
        self.result = result


def new_item(
    action: str,
    place: Any = _ORIGIN,
    yaw: float = math.nan,
    radius: float = math.nan,
    hold_time: float = 0.0,
    values: tuple[float, ...] = (),
) -> Any:
    """Return an item of the autopilot; see MissionItem.msg for the fields."""
    return MissionItem(action, place, yaw, radius, hold_time, values)


def idle() -> Any:
    """Return an item without effect or duration."""
    return new_item("delay")


def _position(m: Any, datum: Datum, required: bool = True) -> Any:
    """Return the position of an item; NaN if it is optional and not specified."""
    if m.frame not in _GLOBAL:
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


def _non_negative(value: float, m: Any, result: int = mavlink.MAV_MISSION_INVALID_PARAM1) -> float:
    """Return a time or number that must not be negative; 0 if it is not specified."""
    if value < 0.0:
        raise RejectedItemError(result, m.seq)
    return 0.0 if math.isnan(value) else value


def _yaw(heading_deg: float) -> float:
    """Return the world yaw [rad] of a heading [deg]."""
    return swap_yaw(math.radians(heading_deg))


def _waypoint(m: Any, datum: Datum) -> Any:
    hold_time, acceptance = _non_negative(m.param1, m), m.param2 if m.param2 > 0.0 else math.nan
    return new_item("waypoint", _position(m, datum), _yaw(m.param4), acceptance, hold_time)


def _loiter_time(m: Any, datum: Datum) -> Any:
    hold_time = _non_negative(m.param1, m)
    return new_item("loiter_time", _position(m, datum, required=False), _yaw(m.param4), hold_time=hold_time)


def _set_home(m: Any, datum: Datum) -> Any:
    if m.param1 == 1.0:  # the vehicle's position at that time
        return new_item("set_home", _UNSET)
    x, y, z = _position(m, datum)
    return new_item("set_home", Vector3(x, y, z - datum.standing_height))


def _turn(m: Any, datum: Datum) -> Any:
    if math.isnan(m.param1):
        raise RejectedItemError(mavlink.MAV_MISSION_INVALID_PARAM1, m.seq)
    if m.param4 == 1.0:  # relative to the current heading; clockwise unless the direction is -1
        angle = math.copysign(math.radians(m.param1), 1.0 if m.param3 == -1.0 else -1.0)
        return new_item("yaw", yaw=angle, values=(1.0,))
    return new_item("yaw", yaw=_yaw(m.param1))


def _speed(m: Any, datum: Datum) -> Any:
    if int(m.param1) not in (0, 1):  # airspeed or ground speed, not climb speed
        return idle()
    if m.param2 == -2.0:  # default speed
        return new_item("speed", values=(math.nan,))
    return new_item("speed", values=(m.param2,)) if m.param2 > 0.0 else idle()


def _jump(m: Any, datum: Datum) -> Any:
    target, times = _non_negative(m.param1, m), _non_negative(m.param2, m, mavlink.MAV_MISSION_INVALID_PARAM2)
    return new_item("jump", values=(float(int(target)), float(int(times))))


Converter = Callable[[Any, Datum], Any]


def _placed(action: str) -> Converter:
    """Return the converter to an action with a heading and an optional position."""
    return lambda m, datum: new_item(action, _position(m, datum, required=False), _yaw(m.param4))


def _circle(action: str) -> Converter:
    def convert(m: Any, datum: Datum) -> Any:
        if not m.param1 > 0.0:
            raise RejectedItemError(mavlink.MAV_MISSION_INVALID_PARAM1, m.seq)
        return new_item(action, _position(m, datum), radius=m.param1, values=(m.param1,))

    return convert


def _vertex(action: str) -> Converter:
    def convert(m: Any, datum: Datum) -> Any:
        if not 3.0 <= m.param1 <= MAX_ITEMS:
            raise RejectedItemError(mavlink.MAV_MISSION_INVALID_PARAM1, m.seq)
        return new_item(action, _position(m, datum), values=(float(int(m.param1)),))

    return convert


def _roi(m: Any, datum: Datum) -> Any:
    return new_item("roi", _position(m, datum))


def _no_roi(m: Any, datum: Datum) -> Any:
    return new_item("roi", _UNSET)


CONVERTERS: dict[int, Converter] = {
    mavlink.MAV_CMD_NAV_WAYPOINT: _waypoint,
    mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT: _waypoint,
    mavlink.MAV_CMD_NAV_TAKEOFF: _placed("takeoff"),
    mavlink.MAV_CMD_NAV_VTOL_TAKEOFF: _placed("takeoff"),
    mavlink.MAV_CMD_NAV_LAND: _placed("land"),
    mavlink.MAV_CMD_NAV_VTOL_LAND: _placed("land"),
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda m, datum: new_item("return"),
    mavlink.MAV_CMD_NAV_LOITER_TIME: _loiter_time,
    mavlink.MAV_CMD_NAV_LOITER_UNLIM: _placed("loiter"),
    mavlink.MAV_CMD_NAV_LOITER_TO_ALT: lambda m, datum: new_item("loiter_to_alt", _position(m, datum, required=False)),
    mavlink.MAV_CMD_DO_SET_ROI_LOCATION: _roi,
    mavlink.MAV_CMD_DO_SET_ROI: lambda m, d: (_roi if int(m.param1) == mavlink.MAV_ROI_LOCATION else _no_roi)(m, d),
    mavlink.MAV_CMD_DO_SET_ROI_NONE: _no_roi,
    mavlink.MAV_CMD_DO_SET_HOME: _set_home,
    mavlink.MAV_CMD_CONDITION_DELAY: lambda m, datum: new_item("condition", hold_time=_non_negative(m.param1, m)),
    mavlink.MAV_CMD_CONDITION_DISTANCE: lambda m, datum: new_item("condition", radius=_non_negative(m.param1, m)),
    mavlink.MAV_CMD_NAV_DELAY: lambda m, datum: new_item("delay", hold_time=_non_negative(m.param1, m)),
    mavlink.MAV_CMD_CONDITION_YAW: _turn,
    mavlink.MAV_CMD_DO_CHANGE_SPEED: _speed,
    mavlink.MAV_CMD_DO_GRIPPER: lambda m, datum: new_item("gripper", values=(m.param2,)),
    mavlink.MAV_CMD_DO_JUMP: _jump,
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION: _circle("fence_circle_in"),
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: _circle("fence_circle_out"),
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION: _vertex("fence_inclusion"),
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION: _vertex("fence_exclusion"),
    mavlink.MAV_CMD_NAV_RALLY_POINT: lambda m, datum: new_item("rally", _position(m, datum)),
}
"""Conversion function by MAV_CMD."""
