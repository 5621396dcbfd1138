"""Conversion of mission, fence and rally-point commands into the autopilot's items."""

import math
from typing import Any

from lapwing.messages import MissionItem, Vector3
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.geo_coordinates import Datum
from lapwing.services.mavlink.item_fields import RejectedItemError, converts, idle, non_negative, position, radius, yaw

MAX_ITEMS = 1000


@converts(mavlink.MAV_CMD_NAV_WAYPOINT, mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT)
def _waypoint(m: Any, datum: Datum) -> Any:
    hold = non_negative(m.param1, mavlink.MAV_MISSION_INVALID_PARAM1, m)
    return MissionItem("waypoint", position(m, datum), yaw(m.param4), radius(m.param2), hold, ())


@converts(mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_NAV_VTOL_TAKEOFF)
def _takeoff(m: Any, datum: Datum) -> Any:
    return MissionItem("takeoff", position(m, datum, required=False), yaw(m.param4), math.nan, 0.0, ())


@converts(mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_VTOL_LAND)
def _land(m: Any, datum: Datum) -> Any:
    return MissionItem("land", position(m, datum, required=False), yaw(m.param4), math.nan, 0.0, ())


@converts(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
def _return(m: Any, datum: Datum) -> Any:
    return MissionItem("return", Vector3(), math.nan, math.nan, 0.0, ())


@converts(mavlink.MAV_CMD_NAV_LOITER_TIME)
def _loiter_time(m: Any, datum: Datum) -> Any:
    hold = non_negative(m.param1, mavlink.MAV_MISSION_INVALID_PARAM1, m)
    return MissionItem("loiter_time", position(m, datum, required=False), yaw(m.param4), math.nan, hold, ())


@converts(mavlink.MAV_CMD_NAV_LOITER_UNLIM)
def _loiter(m: Any, datum: Datum) -> Any:
    return MissionItem("loiter", position(m, datum, required=False), yaw(m.param4), math.nan, 0.0, ())


@converts(mavlink.MAV_CMD_NAV_LOITER_TO_ALT)
def _loiter_to_alt(m: Any, datum: Datum) -> Any:
    return MissionItem("loiter_to_alt", position(m, datum, required=False), math.nan, math.nan, 0.0, ())


@converts(mavlink.MAV_CMD_DO_SET_ROI_LOCATION)
def _roi(m: Any, datum: Datum) -> Any:
    return MissionItem("roi", position(m, datum), math.nan, math.nan, 0.0, ())


@converts(mavlink.MAV_CMD_DO_SET_ROI)
def _old_roi(m: Any, datum: Datum) -> Any:
    location = int(m.param1) == mavlink.MAV_ROI_LOCATION
    return _roi(m, datum) if location else _no_roi(m, datum)


@converts(mavlink.MAV_CMD_DO_SET_ROI_NONE)
def _no_roi(m: Any, datum: Datum) -> Any:
    return MissionItem("roi", Vector3(*(math.nan,) * 3), math.nan, math.nan, 0.0, ())


@converts(mavlink.MAV_CMD_DO_SET_HOME)
def _set_home(m: Any, datum: Datum) -> Any:
    if m.param1 == 1.0:  # the vehicle's position at that time
        return MissionItem("set_home", Vector3(*(math.nan,) * 3), math.nan, math.nan, 0.0, ())
    x, y, z = position(m, datum)
    return MissionItem("set_home", Vector3(x, y, z - datum.standing_height), math.nan, math.nan, 0.0, ())


@converts(mavlink.MAV_CMD_CONDITION_DELAY)
def _condition_delay(m: Any, datum: Datum) -> Any:
    hold = non_negative(m.param1, mavlink.MAV_MISSION_INVALID_PARAM1, m)
    return MissionItem("condition", Vector3(), math.nan, math.nan, hold, ())


@converts(mavlink.MAV_CMD_CONDITION_DISTANCE)
def _condition_distance(m: Any, datum: Datum) -> Any:
    distance = non_negative(m.param1, mavlink.MAV_MISSION_INVALID_PARAM1, m)
    return MissionItem("condition", Vector3(), math.nan, distance, 0.0, ())


@converts(mavlink.MAV_CMD_NAV_DELAY)
def _delay(m: Any, datum: Datum) -> Any:
    hold = non_negative(m.param1, mavlink.MAV_MISSION_INVALID_PARAM1, m)
    return MissionItem("delay", Vector3(), math.nan, math.nan, hold, ())


@converts(mavlink.MAV_CMD_CONDITION_YAW)
def _turn(m: Any, datum: Datum) -> Any:
    if math.isnan(m.param1):
        raise RejectedItemError(mavlink.MAV_MISSION_INVALID_PARAM1, m.seq)
    if m.param4 == 1.0:  # relative to the current heading; clockwise unless the direction is -1
        angle = math.copysign(math.radians(m.param1), 1.0 if m.param3 == -1.0 else -1.0)
        return MissionItem("yaw", Vector3(), angle, math.nan, 0.0, (1.0,))
    return MissionItem("yaw", Vector3(), yaw(m.param1), math.nan, 0.0, ())


@converts(mavlink.MAV_CMD_DO_CHANGE_SPEED)
def _speed(m: Any, datum: Datum) -> Any:
    if int(m.param1) not in (0, 1):  # airspeed or ground speed, not climb speed
        return idle()
    if m.param2 == -2.0:  # default speed
        return MissionItem("speed", Vector3(), math.nan, math.nan, 0.0, (math.nan,))
    if not m.param2 > 0.0:
        return idle()
    return MissionItem("speed", Vector3(), math.nan, math.nan, 0.0, (m.param2,))


@converts(mavlink.MAV_CMD_DO_GRIPPER)
def _gripper(m: Any, datum: Datum) -> Any:
    return MissionItem("gripper", Vector3(), math.nan, math.nan, 0.0, (m.param2,))


@converts(mavlink.MAV_CMD_DO_JUMP)
def _jump(m: Any, datum: Datum) -> Any:
    target, times = (
        non_negative(m.param1, mavlink.MAV_MISSION_INVALID_PARAM1, m),
        non_negative(m.param2, mavlink.MAV_MISSION_INVALID_PARAM2, m),
    )
    return MissionItem("jump", Vector3(), math.nan, math.nan, 0.0, (float(int(target)), float(int(times))))


@converts(mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION)
def _circle(m: Any, datum: Datum) -> Any:
    if not m.param1 > 0.0:
        raise RejectedItemError(mavlink.MAV_MISSION_INVALID_PARAM1, m.seq)
    inside = m.command == mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION
    return MissionItem(
        "fence_circle_in" if inside else "fence_circle_out", position(m, datum), math.nan, m.param1, 0.0, (m.param1,)
    )


@converts(mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION, mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION)
def _vertex(m: Any, datum: Datum) -> Any:
    if not 3.0 <= m.param1 <= MAX_ITEMS:
        raise RejectedItemError(mavlink.MAV_MISSION_INVALID_PARAM1, m.seq)
    inside = m.command == mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
    action = "fence_inclusion" if inside else "fence_exclusion"
    return MissionItem(action, position(m, datum), math.nan, math.nan, 0.0, (float(int(m.param1)),))


@converts(mavlink.MAV_CMD_NAV_RALLY_POINT)
def _rally(m: Any, datum: Datum) -> Any:
    return MissionItem("rally", position(m, datum), math.nan, math.nan, 0.0, ())
