"""PX4: a mode is main << 16 | sub << 24; integers are sent as their bytes."""

import struct

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.firmware import FlightMode
from lapwing.services.mavlink.px4_facts import px4_facts

AUTOPILOT = mavlink.MAV_AUTOPILOT_PX4
HOME_FIRST = GUIDED = False
TAKEOFF_ABOVE_SEA = EVENTS = True
PARAMETER_ENCODING = mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
RATES: dict[str, float] = {}
facts = px4_facts


def custom_mode(main: float, sub: float) -> int:
    """Return the custom mode of a main and a sub mode."""
    return int(main) << 16 | int(sub) << 24


MODES = (  # standard and advanced as in PX4's lib/modes
    FlightMode("altitude_control", "Altitude", custom_mode(2, 0), mavlink.MAV_STANDARD_MODE_ALTITUDE_HOLD, False),
    FlightMode("position_control", "Position", custom_mode(3, 0), mavlink.MAV_STANDARD_MODE_POSITION_HOLD, False),
    FlightMode("stabilized", "Stabilized", custom_mode(7, 0)),
    FlightMode("acro", "Acro", custom_mode(5, 0)),
    FlightMode("mission", "Mission", custom_mode(4, 4), mavlink.MAV_STANDARD_MODE_MISSION),
    FlightMode("hold", "Hold", custom_mode(4, 3)),
    FlightMode("return", "Return", custom_mode(4, 5), mavlink.MAV_STANDARD_MODE_SAFE_RECOVERY),
    FlightMode("offboard", "Offboard", custom_mode(6, 0)),
    FlightMode("takeoff", "Takeoff", custom_mode(4, 2), mavlink.MAV_STANDARD_MODE_TAKEOFF),
    FlightMode("land", "Land", custom_mode(4, 6), mavlink.MAV_STANDARD_MODE_LAND),
)
ORBIT = custom_mode(3, 1)  # entered by DO_ORBIT only
_NUMBERS = {mode.kind: mode.number for mode in MODES} | {"orbit": ORBIT}
_KINDS = {mode.number: mode.kind for mode in MODES} | {custom_mode(1, 0): "stabilized"}  # PX4's Manual of a multirotor
_SHOWN_AS = {"goto": "hold", "descend": "land"}  # substitutes for modes without a number in PX4


def mode_number(mode: str) -> int:
    """Return the custom mode that represents a flight mode; hold if PX4 has no equivalent."""
    return _NUMBERS.get(_SHOWN_AS.get(mode, mode), _NUMBERS["hold"])


def mode_kind(number: int) -> str | None:
    """Return the kind of command that enters a custom mode. Return None if there is none."""
    return _KINDS.get(number & 0xFFFF0000)


def param_float(value: float, integer: bool) -> float:
    """Return a parameter's value as encoded in messages."""
    return struct.unpack("<f", struct.pack("<i", round(value)))[0] if integer else value


def param_value(value: float, integer: bool) -> float:
    """Return a parameter's value decoded from a message."""
    return float(struct.unpack("<i", struct.pack("<f", value))[0]) if integer else value
