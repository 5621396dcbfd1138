"""Flight modes of ArduCopter, and its conventions on MAVLink."""

from lapwing.services.common.firmware.mission_client import Conventions

NAMES = {
    0: "stabilize", 1: "acro", 2: "altitude hold", 3: "auto", 4: "guided", 5: "loiter", 6: "return", 7: "circle",
    9: "land", 11: "drift", 13: "sport", 14: "flip", 15: "autotune", 16: "position hold", 17: "brake", 18: "throw",
    19: "avoid ADS-B", 20: "guided without GPS", 21: "smart return", 22: "flow hold", 23: "follow", 24: "zigzag",
    25: "system identification", 26: "autorotate", 27: "auto return", 28: "turtle",
}  # fmt: skip
AUTO = 3.0
PARAMETERS = {"AUTO_OPTIONS": 3.0, "SIM_SPEEDUP": 1000.0}  # arm and take off in AUTO; no time control

CONVENTIONS = Conventions(
    (AUTO, 0.0), home_first=True, open_value=0.0, bytewise=False,
    mode_name=lambda number: NAMES.get(number, f"mode {number}"), parameters=PARAMETERS,
)  # fmt: skip
