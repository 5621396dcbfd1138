"""PX4: a mode is main << 16 | sub << 24; whole numbers travel as their bytes."""

import struct

from services.mavlink.dialect import mavlink

AUTOPILOT = mavlink.MAV_AUTOPILOT_PX4
HOME_FIRST = False
TAKEOFF_ABOVE_SEA = True
RATES: dict[str, float] = {}

_ALTITUDE, _POSITION, _AUTO, _OFFBOARD = 2, 3, 4, 6
_SHOWN = {  # what a mode looks like
    "takeoff": (_AUTO, 2),
    "hold": (_AUTO, 3),
    "goto": (_AUTO, 3),
    "mission": (_AUTO, 4),
    "return": (_AUTO, 5),
    "land": (_AUTO, 6),
    "descend": (_AUTO, 6),
    "offboard": (_OFFBOARD, 0),
    "position_control": (_POSITION, 0),
    "altitude_control": (_ALTITUDE, 0),
}
_ENTERED = {shown: mode for mode, shown in _SHOWN.items() if mode not in ("goto", "descend")}


def custom_mode(main: float, sub: float) -> int:
    """The number of a main and a sub mode."""
    return int(main) << 16 | int(sub) << 24


def mode_number(mode: str) -> int:
    """The custom mode that shows a mode of ours; what is none of PX4's shows as hold."""
    return custom_mode(*_SHOWN.get(mode, _SHOWN["hold"]))


def mode_kind(number: int) -> str | None:
    """The kind of command that enters a custom mode."""
    return _ENTERED.get((number >> 16 & 0xFF, number >> 24 & 0xFF))


def param_float(value: float, integer: bool) -> float:
    """A parameter as it travels."""
    return struct.unpack("<f", struct.pack("<i", round(value)))[0] if integer else value


def param_value(value: float, integer: bool) -> float:
    """A parameter that has travelled."""
    return float(struct.unpack("<i", struct.pack("<f", value))[0]) if integer else value
