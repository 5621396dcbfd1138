"""Item of a mission, a geofence or a list of rally points, as ground stations save and send it."""

from typing import NamedTuple

MISSION, FENCE, RALLY = 0, 1, 2  # MAV_MISSION_TYPE

# MAV_MISSION_RESULT; as numbers, because MAVLink's messages take long to import
UNSUPPORTED_FRAME, UNSUPPORTED, INVALID, INVALID_PARAM1 = 2, 3, 5, 6
INVALID_PARAM2, INVALID_PARAM4, INVALID_PARAM5, INVALID_PARAM6, INVALID_PARAM7 = 7, 9, 10, 11, 12
INVALID_SEQUENCE, DENIED = 13, 14


class PlanItem(NamedTuple):
    """An item before its conversion. NaN stands for everything that is not specified."""

    number: int  # as ground stations show it, from 1; 0: home, the first item of ArduPilot's missions
    jump_id: int  # number by which DO_JUMP names it
    command: int  # MAV_CMD
    frame: int  # MAV_FRAME
    params: tuple[float, float, float, float]  # the first four
    latitude: float  # [deg]
    longitude: float  # [deg]
    altitude: float  # [m]
    continues: bool = True  # False: the mission stops after the item
    entry: str = ""  # name in a file, for example geoFence.circles[0]; "": its number and command name it


class RefusedItemError(ValueError):
    """Item that cannot be flown; one line.

    Attributes:
        result: MAV_MISSION_RESULT.
        text: reason, and what to do.
        index: position in the list of items.
    """

    def __init__(self, result: int, text: str, index: int = -1, label: str = ""):
        super().__init__(f"{label or f'item {index + 1}'}: {text}")
        self.result, self.text, self.index = result, text, index
