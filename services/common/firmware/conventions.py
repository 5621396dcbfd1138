"""Differences between firmwares on their MAVLink links."""

from collections.abc import Callable
from typing import NamedTuple


class Conventions(NamedTuple):
    """Differences between firmwares."""

    mission_mode: tuple[float, float]  # parameters 2 and 3 of MAV_CMD_DO_SET_MODE
    home_first: bool  # item 0 of a mission is the home position
    open_value: float  # replaces NaN in the parameters of an item
    bytewise: bool  # integer parameters keep their bytes in the float field
    mode_name: Callable[[int], str]  # of a heartbeat's custom_mode
    event_text: Callable[[int, bytes], str] = lambda number, arguments: ""  # of a failsafe's EVENT, "" for others
