"""Conversion of mission, fence and rally items from MAVLink messages to the autopilot's.

An item without effect on this vehicle (cameras, gimbals, servos) becomes a delay of zero length, so that item numbers
are unchanged; `texts_of_skipped_items` lists them.
"""

import math
from collections.abc import Sequence
from typing import Any

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.geo_coordinates import Datum
from lapwing.services.mavlink.item_converters import CONVERTERS, RejectedItemError, idle, new_item

_IDLE = {  # commands for parts that this vehicle does not have
    mavlink.MAV_CMD_DO_SET_ROI_WPNEXT_OFFSET,
    mavlink.MAV_CMD_DO_VTOL_TRANSITION,
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


def texts_of_skipped_items(items: Sequence[Any]) -> list[str]:
    """Return texts about items that are stored but have no effect."""
    names = mavlink.enums["MAV_CMD"]
    return [
        f"item {m.seq}: {names[m.command].name.removeprefix('MAV_CMD_')} skipped" for m in items if m.command in _IDLE
    ]


def from_mavlink(items: Sequence[Any], home_first: bool, datum: Datum) -> list[Any]:
    """Return the autopilot's items of MISSION_ITEM_INT messages.

    Args:
        items: messages in order.
        home_first: True if the first item of a mission is home and not a waypoint.
        datum: reference of coordinates.

    Raises:
        RejectedItemError: an item cannot be flown.
    """
    result = [
        idle() if home_first and number == 0 and m.mission_type == mavlink.MAV_MISSION_TYPE_MISSION else _item(m, datum)
        for number, m in enumerate(items)
    ]
    # ArduPilot's ground stations send 0 for an unspecified heading: its copters turn only by CONDITION_YAW.
    return [
        new_item(i.action, i.position, math.nan, i.radius, i.hold_time, i.values)
        if home_first and i.action != "yaw"
        else i
        for i in result
    ]


def _item(m: Any, datum: Datum) -> Any:
    if m.command in _IDLE:
        return idle()
    action = CONVERTERS.get(m.command)
    if action is None:
        raise RejectedItemError(mavlink.MAV_MISSION_UNSUPPORTED, m.seq)
    if any(map(math.isinf, (m.param1, m.param2, m.param3, m.param4, m.z))):
        raise RejectedItemError(mavlink.MAV_MISSION_INVALID, m.seq)
    return action(m, datum)
