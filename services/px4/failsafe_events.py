"""Texts of PX4's failsafe events: MAVLink EVENT has their cause and action, status texts do not.

Sources: PX4, src/modules/commander/failsafe/framework.cpp and src/lib/events/enums.json; MAVLink guide, "Events
Interface".
"""

import struct

AUTOPILOT = 1  # component of an event, in the highest byte of its id
ACTIONS = (
    "none", "warning", "position mode", "altitude mode", "stabilized mode", "hold", "return", "land", "descend",
    "disarm", "termination",
)  # fmt: skip
CAUSES = (
    "", "loss of manual control", "loss of the ground station", "low battery", "critical battery",
    "emergency battery", "low remaining flight time",
)  # fmt: skip


def event_id(name: str) -> int:
    """Return the id of an event: component, and the lower 24 bits of the FNV-1a hash of its name."""
    result = 0x811C9DC5
    for byte in name.encode():
        result = (result ^ byte) * 0x01000193 & 0xFFFFFFFF
    return AUTOPILOT << 24 | result & 0xFFFFFF


_LAYOUTS = {  # mode, action, delay [s], cause
    event_id("commander_failsafe_enter_generic_hold"): ("<4xBH", ("action", "delay")),
    event_id("commander_failsafe_enter_hold"): ("<4xBHB", ("action", "delay", "cause")),
    event_id("commander_failsafe_enter_autopilot_disengaged"): ("<4xB", ("action",)),
    event_id("commander_failsafe_enter_generic"): ("<4xB", ("action",)),
    event_id("commander_failsafe_enter"): ("<4xBB", ("action", "cause")),
}


def failsafe_text(number: int, arguments: bytes) -> str:
    """Return cause (if known) and action of the failsafe in an event, "" for other events."""
    if number not in _LAYOUTS:
        return ""
    layout, names = _LAYOUTS[number]
    values = dict(zip(names, struct.unpack_from(layout, arguments), strict=True))
    parts = [_name(CAUSES, values.get("cause", 0)), _name(ACTIONS, values["action"])]
    result = ": ".join(filter(None, parts))
    return f"{result} in {values['delay']} s" if "delay" in values else result


def _name(names: tuple[str, ...], number: int) -> str:
    return names[number] if number < len(names) else str(number)
