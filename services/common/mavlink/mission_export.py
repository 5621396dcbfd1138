"""Conversion of the autopilot's mission items to MAVLink messages, for missions that no endpoint has uploaded."""

import math
from collections.abc import Callable, Sequence
from typing import Any

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.frames import saturate, swap_yaw
from lapwing.services.common.mavlink.geo_coordinates import Datum, from_world

GROUND_SPEED, NO_THROTTLE, DEFAULT_SPEED = 1.0, -1.0, -2.0  # parameters of DO_CHANGE_SPEED
_WITHOUT_POSITION = ("gripper", "return", "delay", "condition", "jump", "speed", "yaw")
_POSITION_UNSET = {"roi": mavlink.MAV_CMD_DO_SET_ROI_NONE}  # command if the position is NaN
_Params = tuple[float, ...]


def _heading(yaw: float) -> float:
    """Return the heading [deg] of a world yaw [rad]."""
    return math.degrees(swap_yaw(yaw))


def _radius(item: Any) -> float:
    return item.radius if item.radius > 0.0 else 0.0


def _circle(item: Any) -> _Params:
    """Return the parameters of DO_ORBIT."""
    angle, speed, behaviour = item.values[:3]
    return -math.copysign(item.radius, angle), speed, behaviour, abs(angle)


def _turns(item: Any) -> _Params:
    """Return the parameters of NAV_LOITER_TURNS."""
    return abs(item.values[0]) / math.tau, 0.0, -math.copysign(item.radius, item.values[0])


def _turn(item: Any) -> _Params:
    relative, *direction = item.values or (0.0,)
    if relative:
        return math.degrees(abs(item.yaw)), 0.0, -math.copysign(1.0, item.yaw), 1.0
    return _heading(item.yaw) % 360.0, 0.0, -direction[0] if direction else 0.0


_COMMANDS: dict[str, tuple[int, Callable[[Any], _Params]]] = {  # by action: MAV_CMD and its first parameters
    "waypoint": (mavlink.MAV_CMD_NAV_WAYPOINT, lambda i: (i.hold_time, _radius(i), 0.0, _heading(i.yaw))),
    "takeoff": (mavlink.MAV_CMD_NAV_TAKEOFF, lambda i: (0.0, 0.0, 0.0, _heading(i.yaw))),
    "land": (mavlink.MAV_CMD_NAV_LAND, lambda i: (0.0, 0.0, 0.0, _heading(i.yaw))),
    "return": (mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH, lambda i: ()),
    "loiter_time": (mavlink.MAV_CMD_NAV_LOITER_TIME, lambda i: (i.hold_time, 0.0, 0.0, _heading(i.yaw))),
    "delay": (mavlink.MAV_CMD_NAV_DELAY, lambda i: (i.hold_time, -1.0, -1.0, -1.0)),
    "jump": (mavlink.MAV_CMD_DO_JUMP, lambda i: i.values[:2]),
    "speed": (
        mavlink.MAV_CMD_DO_CHANGE_SPEED,
        lambda i: (GROUND_SPEED, DEFAULT_SPEED if math.isnan(i.values[0]) else i.values[0], NO_THROTTLE),
    ),
    "yaw": (mavlink.MAV_CMD_CONDITION_YAW, lambda i: _turn(i)),
    "loiter": (mavlink.MAV_CMD_NAV_LOITER_UNLIM, lambda i: (0.0, 0.0, 0.0, _heading(i.yaw))),
    "gripper": (mavlink.MAV_CMD_DO_GRIPPER, lambda i: (1.0, i.values[0])),
    "loiter_to_alt": (mavlink.MAV_CMD_NAV_LOITER_TO_ALT, lambda i: ()),
    "orbit": (mavlink.MAV_CMD_DO_ORBIT, _circle),
    "roi": (mavlink.MAV_CMD_DO_SET_ROI_LOCATION, lambda i: ()),
    "set_home": (mavlink.MAV_CMD_DO_SET_HOME, lambda i: (float(math.isnan(i.position.x)),)),
    "condition": (mavlink.MAV_CMD_CONDITION_DELAY, lambda i: (i.hold_time,)),
    "fence_inclusion": (mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION, lambda i: i.values[:1]),
    "fence_exclusion": (mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION, lambda i: i.values[:1]),
    "fence_circle_in": (mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, lambda i: (i.radius,)),
    "fence_circle_out": (mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION, lambda i: (i.radius,)),
    "rally": (mavlink.MAV_CMD_NAV_RALLY_POINT, lambda i: ()),
}


def to_mavlink(items: Sequence[Any], kind: int, datum: Datum) -> list[Any]:
    """Return the MISSION_ITEM_INT messages of the autopilot's items; `kind` is the MAV_MISSION_TYPE."""
    return [_item(number, item, kind, datum) for number, item in enumerate(items)]


def _item(number: int, item: Any, kind: int, datum: Datum) -> Any:
    command, parameters = _COMMANDS[item.action]
    if item.action == "condition" and item.radius > 0.0:
        command, parameters = mavlink.MAV_CMD_CONDITION_DISTANCE, lambda i: (i.radius,)
    if item.action == "orbit" and math.isnan(item.values[1]):
        command, parameters = mavlink.MAV_CMD_NAV_LOITER_TURNS, _turns
    if item.action in _POSITION_UNSET and math.isnan(item.position.x):
        command = _POSITION_UNSET[item.action]
    params = (*parameters(item), 0.0, 0.0, 0.0, 0.0)[:4]
    frame, place = _frame_and_position(item, datum)
    return mavlink.MAVLink_mission_item_int_message(0, 0, number, frame, command, 0, 1, *params, *place, kind)


def _frame_and_position(item: Any, datum: Datum) -> tuple[int, tuple[int, int, float]]:
    """Return the MAV_FRAME and the position in it; an unspecified coordinate is 0, an unspecified altitude NaN."""
    if item.action in _WITHOUT_POSITION:
        return mavlink.MAV_FRAME_MISSION, (0, 0, 0.0)
    frame = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
    x, y, z = item.position
    if item.action == "set_home":
        z += datum.standing_height
    if math.isnan(x) or math.isnan(y):
        return frame, (0, 0, z - datum.home_z)
    latitude, longitude, altitude = from_world(datum, (x, y, 0.0 if math.isnan(z) else z))
    return frame, (saturate(latitude * 1e7, 32), saturate(longitude * 1e7, 32), z if math.isnan(z) else altitude)
