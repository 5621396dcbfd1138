"""Conversion of mission, fence and rally-point commands into the autopilot's items."""

import math
from typing import Any

from lapwing.messages import MissionItem, Vector3
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.geo_coordinates import Datum
from lapwing.services.mavlink.item_fields import RefusedItemError, idle, length, makes, place, radius, yaw

MAX_ITEMS = 1000


@makes(mavlink.MAV_CMD_NAV_WAYPOINT, mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT)
def _waypoint(m: Any, datum: Datum) -> Any:
    hold = length(m.param1, mavlink.MAV_MISSION_INVALID_PARAM1, m)
    return MissionItem("waypoint", place(m, datum), yaw(m.param4), radius(m.param2), hold, ())


@makes(mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_NAV_VTOL_TAKEOFF)
def _takeoff(m: Any, datum: Datum) -> Any:
    return MissionItem("takeoff", place(m, datum, needed=False), yaw(m.param4), math.nan, 0.0, ())


@makes(mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_VTOL_LAND)
def _land(m: Any, datum: Datum) -> Any:
    return MissionItem("land", place(m, datum, needed=False), yaw(m.param4), math.nan, 0.0, ())


@makes(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
def _return(m: Any, datum: Datum) -> Any:
    return MissionItem("return", Vector3(), math.nan, math.nan, 0.0, ())


@makes(mavlink.MAV_CMD_NAV_LOITER_TIME)
def _loiter_time(m: Any, datum: Datum) -> Any:
    hold = length(m.param1, mavlink.MAV_MISSION_INVALID_PARAM1, m)
    return MissionItem("loiter_time", place(m, datum, needed=False), yaw(m.param4), math.nan, hold, ())


@makes(mavlink.MAV_CMD_NAV_LOITER_UNLIM)
def _loiter(m: Any, datum: Datum) -> Any:
    return MissionItem("loiter", place(m, datum, needed=False), yaw(m.param4), math.nan, 0.0, ())


@makes(mavlink.MAV_CMD_NAV_LOITER_TO_ALT)
def _loiter_to_alt(m: Any, datum: Datum) -> Any:
    return MissionItem("loiter_to_alt", place(m, datum, needed=False), math.nan, math.nan, 0.0, ())


@makes(mavlink.MAV_CMD_DO_SET_ROI_LOCATION)
def _roi(m: Any, datum: Datum) -> Any:
    return MissionItem("roi", place(m, datum), math.nan, math.nan, 0.0, ())


@makes(mavlink.MAV_CMD_DO_SET_ROI)
def _old_roi(m: Any, datum: Datum) -> Any:
    location = int(m.param1) == mavlink.MAV_ROI_LOCATION
    return _roi(m, datum) if location else _no_roi(m, datum)


@makes(mavlink.MAV_CMD_DO_SET_ROI_NONE)
def _no_roi(m: Any, datum: Datum) -> Any:
    return MissionItem("roi", Vector3(*(math.nan,) * 3), math.nan, math.nan, 0.0, ())


@makes(mavlink.MAV_CMD_DO_SET_HOME)
def _set_home(m: Any, datum: Datum) -> Any:
    if m.param1 == 1.0:  # where it is then
        return MissionItem("set_home", Vector3(*(math.nan,) * 3), math.nan, math.nan, 0.0, ())
    x, y, z = place(m, datum)
    return MissionItem("set_home", Vector3(x, y, z - datum.standing_height), math.nan, math.nan, 0.0, ())


@makes(mavlink.MAV_CMD_CONDITION_DELAY)
def _condition_delay(m: Any, datum: Datum) -> Any:
    hold = length(m.param1, mavlink.MAV_MISSION_INVALID_PARAM1, m)
    return MissionItem("condition", Vector3(), math.nan, math.nan, hold, ())


@makes(mavlink.MAV_CMD_CONDITION_DISTANCE)
def _condition_distance(m: Any, datum: Datum) -> Any:
    distance = length(m.param1, mavlink.MAV_MISSION_INVALID_PARAM1, m)
    return MissionItem("condition", Vector3(), math.nan, distance, 0.0, ())


@makes(mavlink.MAV_CMD_NAV_DELAY)
def _delay(m: Any, datum: Datum) -> Any:
    hold = length(m.param1, mavlink.MAV_MISSION_INVALID_PARAM1, m)
    return MissionItem("delay", Vector3(), math.nan, math.nan, hold, ())


@makes(mavlink.MAV_CMD_CONDITION_YAW)
def _turn(m: Any, datum: Datum) -> Any:
    if math.isnan(m.param1):
        raise RefusedItemError(mavlink.MAV_MISSION_INVALID_PARAM1, m.seq)
    if m.param4 == 1.0:  # an angle from the heading that it then has, clockwise unless its direction is -1
        angle = math.copysign(math.radians(m.param1), 1.0 if m.param3 == -1.0 else -1.0)
        return MissionItem("yaw", Vector3(), angle, math.nan, 0.0, (1.0,))
    return MissionItem("yaw", Vector3(), yaw(m.param1), math.nan, 0.0, ())


@makes(mavlink.MAV_CMD_DO_CHANGE_SPEED)
def _speed(m: Any, datum: Datum) -> Any:
    if int(m.param1) not in (0, 1):  # of the air, over the ground; not of climbing
        return idle()
    if m.param2 == -2.0:  # the usual one
        return MissionItem("speed", Vector3(), math.nan, math.nan, 0.0, (math.nan,))
    if not m.param2 > 0.0:
        return idle()
    return MissionItem("speed", Vector3(), math.nan, math.nan, 0.0, (m.param2,))


@makes(mavlink.MAV_CMD_DO_GRIPPER)
def _gripper(m: Any, datum: Datum) -> Any:
    return MissionItem("gripper", Vector3(), math.nan, math.nan, 0.0, (m.param2,))


@makes(mavlink.MAV_CMD_DO_JUMP)
def _jump(m: Any, datum: Datum) -> Any:
    target, times = (
        length(m.param1, mavlink.MAV_MISSION_INVALID_PARAM1, m),
        length(m.param2, mavlink.MAV_MISSION_INVALID_PARAM2, m),
    )
    return MissionItem("jump", Vector3(), math.nan, math.nan, 0.0, (float(int(target)), float(int(times))))


@makes(mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION)
def _circle(m: Any, datum: Datum) -> Any:
    if not m.param1 > 0.0:
        raise RefusedItemError(mavlink.MAV_MISSION_INVALID_PARAM1, m.seq)
    inside = m.command == mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION
    return MissionItem(
        "fence_circle_in" if inside else "fence_circle_out", place(m, datum), math.nan, m.param1, 0.0, (m.param1,)
    )


@makes(
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
)
def _vertex(m: Any, datum: Datum) -> Any:
    if not 3.0 <= m.param1 <= MAX_ITEMS:
        raise RefusedItemError(mavlink.MAV_MISSION_INVALID_PARAM1, m.seq)
    inside = m.command == mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
    action = "fence_inclusion" if inside else "fence_exclusion"
    return MissionItem(action, place(m, datum), math.nan, math.nan, 0.0, (float(int(m.param1)),))


@makes(mavlink.MAV_CMD_NAV_RALLY_POINT)
def _rally(m: Any, datum: Datum) -> Any:
    return MissionItem("rally", place(m, datum), math.nan, math.nan, 0.0, ())
