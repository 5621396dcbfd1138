"""Mission of a firmware as messages of the mission protocol.

Apart from `mission`, which every command imports: MAVLink's messages are a twentieth of the time of its start.
"""

import math
from collections.abc import Sequence
from typing import Any

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.geo_coordinates import Datum
from lapwing.services.common.mavlink.mission_export import to_mavlink

UPLOAD = "mission_upload"


def mission_items(commands: Sequence[Any]) -> tuple[Any, ...]:
    """Return the mission items among operator commands."""
    return next((tuple(command.items) for command in commands if command.kind == UPLOAD), ())


def mission_messages(items: Sequence[Any], datum: Datum) -> list[Any]:
    """Return the MISSION_ITEM_INT messages of mission items."""
    return to_mavlink(items, mavlink.MAV_MISSION_TYPE_MISSION, datum)


def item_message(items: Sequence[Any], number: int, target: int, seq: int, open_value: float) -> Any:
    """Return the answer to the request of a mission item.

    Args:
        items: MISSION_ITEM_INT messages.
        number: index of the item; -1: the home position, which the firmware knows.
        target: system id of the firmware.
        seq: number that the firmware requests.
        open_value: replacement of NaN in the parameters.
    """
    parameters: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    if number < 0:
        frame, command, place = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, mavlink.MAV_CMD_NAV_WAYPOINT, (0, 0, 0.0)
    else:
        item = items[number]
        frame, command, place = item.frame, item.command, (item.x, item.y, item.z)
        values = (item.param1, item.param2, item.param3, item.param4)
        parameters = tuple(open_value if math.isnan(value) else value for value in values)
    return mavlink.MAVLink_mission_item_int_message(target, 1, seq, frame, command, 0, 1, *parameters, *place)


def result_name(result: int) -> str:
    """Return the name of a MAV_MISSION_RESULT in lower case."""
    entry = mavlink.enums["MAV_MISSION_RESULT"].get(result)
    return entry.name.lower() if entry else str(result)
