"""ArduPilot's copter: modes by number; whole numbers travel as floats of the same value."""

from services.mavlink.dialect import mavlink

AUTOPILOT = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
HOME_FIRST = True
TAKEOFF_ABOVE_SEA = False
RATES = {"EKF_STATUS_REPORT": 1.0}  # dronekit waits for it

_ALT_HOLD, _AUTO, _GUIDED, _LOITER, _RTL, _LAND, _POSHOLD, _BRAKE = 2, 3, 4, 5, 6, 9, 16, 17
_SHOWN = {  # what a mode looks like
    "takeoff": _GUIDED,
    "hold": _GUIDED,
    "goto": _GUIDED,
    "offboard": _GUIDED,
    "mission": _AUTO,
    "return": _RTL,
    "land": _LAND,
    "descend": _LAND,
    "position_control": _LOITER,
    "altitude_control": _ALT_HOLD,
}
_ENTERED = {
    _AUTO: "mission",
    _GUIDED: "hold",
    _LOITER: "position_control",
    _ALT_HOLD: "altitude_control",
    _POSHOLD: "position_control",
    _BRAKE: "hold",
    _RTL: "return",
    _LAND: "land",
}


def custom_mode(main: float, sub: float) -> int:
    """The number of a mode."""
    return int(main)


def mode_number(mode: str) -> int:
    """The custom mode that shows a mode of ours; what is none of ArduPilot's shows as GUIDED."""
    return _SHOWN.get(mode, _GUIDED)


def mode_kind(number: int) -> str | None:
    """The kind of command that enters a custom mode."""
    return _ENTERED.get(number)


def param_float(value: float, integer: bool) -> float:
    """A parameter as it travels."""
    return float(round(value)) if integer else value


def param_value(value: float, integer: bool) -> float:
    """A parameter that has travelled."""
    return float(round(value)) if integer else value
