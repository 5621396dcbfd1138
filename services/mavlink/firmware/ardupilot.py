"""ArduPilot's copter: modes by number; integers are sent as floats of the same value."""

import math
from collections.abc import Sequence

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.firmware import FlightMode
from lapwing.services.mavlink.px4_facts import Fact
from lapwing.services.mavlink.vehicle_description import VehicleDescription

AUTOPILOT = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
HOME_FIRST = GUIDED = True
TAKEOFF_ABOVE_SEA = EVENTS = False
PARAMETER_ENCODING = mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST
RATES = {"EKF_STATUS_REPORT": 1.0}  # dronekit waits for it

_STABILIZE, _ACRO, _CIRCLE = 0, 1, 7
_ALT_HOLD, _AUTO, _GUIDED, _LOITER, _RTL, _LAND, _POSHOLD, _BRAKE = 2, 3, 4, 5, 6, 9, 16, 17
_SHOWN = {  # displayed mode by mode of the autopilot
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
    "stabilized": _STABILIZE,
    "acro": _ACRO,
    "orbit": _CIRCLE,
}
MODES = (
    FlightMode("stabilized", "STABILIZE", _STABILIZE),
    FlightMode("acro", "ACRO", _ACRO),
    FlightMode("altitude_control", "ALT_HOLD", _ALT_HOLD, advanced=False),
    FlightMode("mission", "AUTO", _AUTO, mavlink.MAV_STANDARD_MODE_MISSION),
    FlightMode("hold", "GUIDED", _GUIDED),
    FlightMode("position_control", "LOITER", _LOITER, advanced=False),
    FlightMode("return", "RTL", _RTL, mavlink.MAV_STANDARD_MODE_SAFE_RECOVERY),
    FlightMode("land", "LAND", _LAND, mavlink.MAV_STANDARD_MODE_LAND),
    FlightMode("position_control", "POSHOLD", _POSHOLD, advanced=False),
    FlightMode("hold", "BRAKE", _BRAKE),
)
_KINDS = {mode.number: mode.kind for mode in MODES}


def facts(description: VehicleDescription) -> Sequence[Fact]:
    """Return no facts: ArduPilot's ground stations request others."""
    return ()


def custom_mode(main: float, sub: float) -> int:
    """Return the number of a mode."""
    return int(main)


def mode_number(mode: str) -> int:
    """Return the custom mode that represents a flight mode; GUIDED if ArduPilot has no equivalent."""
    return _SHOWN.get(mode, _GUIDED)


def mode_kind(number: int) -> str | None:
    """Return the kind of command that enters a custom mode. Return None if there is none."""
    return _KINDS.get(number)


def param_float(value: float, integer: bool) -> float:
    """Return a parameter's value as encoded in messages."""
    return float(round(value)) if integer else value


def param_value(value: float, integer: bool) -> float:
    """Return a parameter's value decoded from a message."""
    return float(round(value)) if integer and math.isfinite(value) else value
