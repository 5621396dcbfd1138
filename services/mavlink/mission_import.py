"""Items of missions, fences and rally points from MAVLink messages to the autopilot's.

An item that this vehicle has nothing to do for (cameras, gimbals, servos) becomes a delay of no length, so that the
numbers of the items stay; `skipped` names them.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

from messages import MissionItem, Vector3
from services.mavlink.coordinates import ABOVE_HOME, ABOVE_SEA, Datum, degrees, to_world
from services.mavlink.dialect import mavlink
from services.mavlink.frames import swap_yaw

MAX_ITEMS = 1000

_ON_GLOBE = ABOVE_SEA | ABOVE_HOME
_IDLE = {  # commands of a mission for parts that this vehicle does not have
    mavlink.MAV_CMD_DO_SET_ROI_WPNEXT_OFFSET,
    mavlink.MAV_CMD_DO_VTOL_TRANSITION,
    mavlink.MAV_CMD_DO_GRIPPER,
    mavlink.MAV_CMD_DO_WINCH,
    mavlink.MAV_CMD_DO_PARACHUTE,
    mavlink.MAV_CMD_DO_SET_ACTUATOR,
    mavlink.MAV_CMD_DO_FENCE_ENABLE,
    mavlink.MAV_CMD_DO_TRIGGER_CONTROL,
    mavlink.MAV_CMD_DO_CONTROL_VIDEO,
    mavlink.MAV_CMD_CONDITION_GATE,
    mavlink.MAV_CMD_OBLIQUE_SURVEY,
    mavlink.MAV_CMD_DO_MOUNT_CONFIGURE,
    mavlink.MAV_CMD_DO_MOUNT_CONTROL,
    mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW,
    mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE,
    mavlink.MAV_CMD_DO_DIGICAM_CONTROL,
    mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST,
    mavlink.MAV_CMD_DO_SET_CAM_TRIGG_INTERVAL,
    mavlink.MAV_CMD_SET_CAMERA_MODE,
    mavlink.MAV_CMD_SET_CAMERA_ZOOM,
    mavlink.MAV_CMD_SET_CAMERA_FOCUS,
    mavlink.MAV_CMD_IMAGE_START_CAPTURE,
    mavlink.MAV_CMD_IMAGE_STOP_CAPTURE,
    mavlink.MAV_CMD_VIDEO_START_CAPTURE,
    mavlink.MAV_CMD_VIDEO_STOP_CAPTURE,
    mavlink.MAV_CMD_DO_SET_SERVO,
    mavlink.MAV_CMD_DO_SET_RELAY,
    mavlink.MAV_CMD_DO_LAND_START,
}


class RefusedItemError(ValueError):
    """An item that cannot be flown; `result` is the MAV_MISSION_RESULT."""

    def __init__(self, result: int, item: int = 0):
        super().__init__(f"item {item}: {mavlink.enums['MAV_MISSION_RESULT'][result].name}")
        self.result = result


def skipped(items: Sequence[Any]) -> list[str]:
    """What is kept and does nothing, in words."""
    names = mavlink.enums["MAV_CMD"]
    return [
        f"item {m.seq}: {names[m.command].name.removeprefix('MAV_CMD_')} skipped" for m in items if m.command in _IDLE
    ]


Maker = Callable[[Any, Datum], Any]

_ACTIONS: dict[int, Maker] = {}


def _makes(*commands: int) -> Callable[[Maker], Maker]:
    def declare(function: Maker) -> Maker:
        _ACTIONS.update(dict.fromkeys(commands, function))
        return function

    return declare


def from_mavlink(items: Sequence[Any], home_first: bool, datum: Datum) -> list[Any]:
    """The autopilot's items of MISSION_ITEM_INT messages.

    Args:
        items: in order.
        home_first: the first of a mission is where home is, and not to be flown to.
        datum: what places count from.

    Raises:
        RefusedItemError: one cannot be flown.
    """
    found = [
        _idle()
        if home_first and number == 0 and m.mission_type == mavlink.MAV_MISSION_TYPE_MISSION
        else _item(m, datum)
        for number, m in enumerate(items)
    ]
    # ArduPilot's ground stations write 0 where they mean no heading: its copter turns by CONDITION_YAW alone.
    return [_without_heading(i) if home_first and i.action != "yaw" else i for i in found]


def _without_heading(i: Any) -> Any:
    return MissionItem(i.action, i.position, math.nan, i.radius, i.hold, i.values)


def _item(m: Any, datum: Datum) -> Any:
    if m.command in _IDLE:
        return _idle()
    action = _ACTIONS.get(m.command)
    if action is None:
        raise RefusedItemError(mavlink.MAV_MISSION_UNSUPPORTED, m.seq)
    if any(map(math.isinf, (m.param1, m.param2, m.param3, m.param4, m.z))):
        raise RefusedItemError(mavlink.MAV_MISSION_INVALID, m.seq)
    return action(m, datum)


def _idle() -> Any:
    return MissionItem("delay", Vector3(), math.nan, math.nan, 0.0, ())


def _place(m: Any, datum: Datum, needed: bool = True) -> Any:
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


def _length(value: float, result: int, m: Any) -> float:
    """A time or a number that must not be negative; one that is not given is 0."""
    if value < 0.0:
        raise RefusedItemError(result, m.seq)
    return 0.0 if math.isnan(value) else value


def _radius(value: float) -> float:
    """Acceptance radius [m]; NaN, for the autopilot's own, where none is given."""
    return value if value > 0.0 else math.nan


def _yaw(value: float) -> float:
    """World yaw [rad] of a heading [deg]."""
    return swap_yaw(math.radians(value))


@_makes(mavlink.MAV_CMD_NAV_WAYPOINT, mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT)
def _waypoint(m: Any, datum: Datum) -> Any:
    hold = _length(m.param1, mavlink.MAV_MISSION_INVALID_PARAM1, m)
    return MissionItem("waypoint", _place(m, datum), _yaw(m.param4), _radius(m.param2), hold, ())


@_makes(mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_NAV_VTOL_TAKEOFF)
def _takeoff(m: Any, datum: Datum) -> Any:
    return MissionItem("takeoff", _place(m, datum, needed=False), _yaw(m.param4), math.nan, 0.0, ())


@_makes(mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_VTOL_LAND)
def _land(m: Any, datum: Datum) -> Any:
    return MissionItem("land", _place(m, datum, needed=False), _yaw(m.param4), math.nan, 0.0, ())


@_makes(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
def _return(m: Any, datum: Datum) -> Any:
    return MissionItem("return", Vector3(), math.nan, math.nan, 0.0, ())


@_makes(mavlink.MAV_CMD_NAV_LOITER_TIME)
def _loiter_time(m: Any, datum: Datum) -> Any:
    hold = _length(m.param1, mavlink.MAV_MISSION_INVALID_PARAM1, m)
    return MissionItem("loiter_time", _place(m, datum, needed=False), _yaw(m.param4), math.nan, hold, ())


@_makes(mavlink.MAV_CMD_NAV_LOITER_UNLIM)
def _loiter(m: Any, datum: Datum) -> Any:
    return MissionItem("loiter", _place(m, datum, needed=False), _yaw(m.param4), math.nan, 0.0, ())


@_makes(mavlink.MAV_CMD_NAV_LOITER_TO_ALT)
def _loiter_to_alt(m: Any, datum: Datum) -> Any:
    return MissionItem("loiter_to_alt", _place(m, datum, needed=False), math.nan, math.nan, 0.0, ())


@_makes(mavlink.MAV_CMD_DO_SET_ROI_LOCATION)
def _roi(m: Any, datum: Datum) -> Any:
    return MissionItem("roi", _place(m, datum), math.nan, math.nan, 0.0, ())


@_makes(mavlink.MAV_CMD_DO_SET_ROI)
def _old_roi(m: Any, datum: Datum) -> Any:
    location = int(m.param1) == mavlink.MAV_ROI_LOCATION
    return _roi(m, datum) if location else _no_roi(m, datum)


@_makes(mavlink.MAV_CMD_DO_SET_ROI_NONE)
def _no_roi(m: Any, datum: Datum) -> Any:
    return MissionItem("roi", Vector3(*(math.nan,) * 3), math.nan, math.nan, 0.0, ())


@_makes(mavlink.MAV_CMD_DO_SET_HOME)
def _set_home(m: Any, datum: Datum) -> Any:
    if m.param1 == 1.0:  # where it is then
        return MissionItem("set_home", Vector3(*(math.nan,) * 3), math.nan, math.nan, 0.0, ())
    x, y, z = _place(m, datum)
    return MissionItem("set_home", Vector3(x, y, z - datum.standing_height), math.nan, math.nan, 0.0, ())


@_makes(mavlink.MAV_CMD_CONDITION_DELAY)
def _condition_delay(m: Any, datum: Datum) -> Any:
    hold = _length(m.param1, mavlink.MAV_MISSION_INVALID_PARAM1, m)
    return MissionItem("condition", Vector3(), math.nan, math.nan, hold, ())


@_makes(mavlink.MAV_CMD_CONDITION_DISTANCE)
def _condition_distance(m: Any, datum: Datum) -> Any:
    distance = _length(m.param1, mavlink.MAV_MISSION_INVALID_PARAM1, m)
    return MissionItem("condition", Vector3(), math.nan, distance, 0.0, ())


@_makes(mavlink.MAV_CMD_NAV_DELAY)
def _delay(m: Any, datum: Datum) -> Any:
    hold = _length(m.param1, mavlink.MAV_MISSION_INVALID_PARAM1, m)
    return MissionItem("delay", Vector3(), math.nan, math.nan, hold, ())


@_makes(mavlink.MAV_CMD_CONDITION_YAW)
def _turn(m: Any, datum: Datum) -> Any:
    if math.isnan(m.param1):
        raise RefusedItemError(mavlink.MAV_MISSION_INVALID_PARAM1, m.seq)
    if m.param4 == 1.0:  # an angle from the heading that it then has, clockwise unless its direction is -1
        angle = math.copysign(math.radians(m.param1), 1.0 if m.param3 == -1.0 else -1.0)
        return MissionItem("yaw", Vector3(), angle, math.nan, 0.0, (1.0,))
    return MissionItem("yaw", Vector3(), _yaw(m.param1), math.nan, 0.0, ())


@_makes(mavlink.MAV_CMD_DO_CHANGE_SPEED)
def _speed(m: Any, datum: Datum) -> Any:
    if int(m.param1) not in (0, 1):  # of the air, over the ground; not of climbing
        return _idle()
    if m.param2 == -2.0:  # the usual one
        return MissionItem("speed", Vector3(), math.nan, math.nan, 0.0, (math.nan,))
    if not m.param2 > 0.0:
        return _idle()
    return MissionItem("speed", Vector3(), math.nan, math.nan, 0.0, (m.param2,))


@_makes(mavlink.MAV_CMD_DO_JUMP)
def _jump(m: Any, datum: Datum) -> Any:
    target, times = (
        _length(m.param1, mavlink.MAV_MISSION_INVALID_PARAM1, m),
        _length(m.param2, mavlink.MAV_MISSION_INVALID_PARAM2, m),
    )
    return MissionItem("jump", Vector3(), math.nan, math.nan, 0.0, (float(int(target)), float(int(times))))


@_makes(mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION)
def _circle(m: Any, datum: Datum) -> Any:
    if not m.param1 > 0.0:
        raise RefusedItemError(mavlink.MAV_MISSION_INVALID_PARAM1, m.seq)
    inside = m.command == mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION
    return MissionItem(
        "fence_circle_in" if inside else "fence_circle_out", _place(m, datum), math.nan, m.param1, 0.0, (m.param1,)
    )


@_makes(
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
)
def _vertex(m: Any, datum: Datum) -> Any:
    if not 3.0 <= m.param1 <= MAX_ITEMS:
        raise RefusedItemError(mavlink.MAV_MISSION_INVALID_PARAM1, m.seq)
    inside = m.command == mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
    action = "fence_inclusion" if inside else "fence_exclusion"
    return MissionItem(action, _place(m, datum), math.nan, math.nan, 0.0, (float(int(m.param1)),))


@_makes(mavlink.MAV_CMD_NAV_RALLY_POINT)
def _rally(m: Any, datum: Datum) -> Any:
    return MissionItem("rally", _place(m, datum), math.nan, math.nan, 0.0, ())
