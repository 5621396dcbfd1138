"""Flight modes of PX4, its conventions on MAVLink, and the texts of its failsafe events.

MAVLink EVENT has cause and action of a failsafe, status texts do not. Sources: PX4,
src/modules/commander/failsafe/framework.cpp and src/lib/events/enums.json; MAVLink guide, "Events Interface".
"""

import math
import struct

from lapwing.services.common.firmware.mission_client import Conventions

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
_WARNINGS = {
    event_id(f"commander_failsafe_enter_{name}")
    for name in ("generic_warn", "warn", "low_bat", "crit_bat_warn", "crit_low_bat_warn", "low_flight_time_warn")
}


def failsafe_text(number: int, arguments: bytes) -> str | None:
    """Return cause (if known) and action of the failsafe in an event, "" of a warning, None for other events."""
    if number not in _LAYOUTS:
        return "" if number in _WARNINGS else None
    layout, names = _LAYOUTS[number]
    values = dict(zip(names, struct.unpack_from(layout, arguments), strict=True))
    parts = [_name(CAUSES, values.get("cause", 0)), _name(ACTIONS, values["action"])]
    result = ": ".join(filter(None, parts))
    return f"{result} in {values['delay']} s" if "delay" in values else result


def _name(names: tuple[str, ...], number: int) -> str:
    return names[number] if number < len(names) else str(number)


MAIN = {
    1: "manual", 2: "altitude control", 3: "position control", 4: "auto", 5: "acro", 6: "offboard", 7: "stabilized",
    8: "rattitude", 10: "termination",
}  # fmt: skip
AUTO_MODES = {
    1: "ready", 2: "take-off", 3: "hold", 4: "mission", 5: "return", 6: "land", 8: "follow", 9: "precision land",
}  # fmt: skip
AUTO, MISSION = 4.0, 4.0


def mode_name(custom_mode: int) -> str:
    """Return the name of a heartbeat's custom_mode: main mode in bits 16 to 23, sub-mode above."""
    main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24
    if main == AUTO:
        return AUTO_MODES.get(sub, f"auto {sub}")
    return MAIN.get(main, f"mode {main}")


CONVENTIONS = Conventions(
    (AUTO, MISSION), home_first=False, open_value=math.nan, bytewise=True, mode_name=mode_name, event_text=failsafe_text
)
