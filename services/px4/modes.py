"""Flight modes of PX4, and its conventions on MAVLink."""

import math

from lapwing.services.common.firmware.conventions import Conventions
from lapwing.services.px4.failsafe_events import failsafe_text

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
    (AUTO, MISSION),
    home_first=False,
    open_value=math.nan,
    bytewise=True,
    mode_name=mode_name,
    event_text=failsafe_text,
)
