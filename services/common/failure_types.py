"""Units and failure types of MAVLink's failure injection."""

from collections.abc import Mapping
from typing import NamedTuple

KINDS = ("sound", "off", "stuck", "garbage", "wrong", "slow", "delayed", "intermittent")
"""Failure types, numbered as MAVLink's FAILURE_TYPE."""
SOUND, OFF, STUCK, GARBAGE, WRONG, SLOW, DELAYED, INTERMITTENT = range(len(KINDS))
UNITS = (
    "gyro", "accelerometer", "magnetometer", "barometer", "gps", "distance_sensor", "battery", "motor", "optical_flow",
    "airspeed",
)  # fmt: skip
"""Units, in the order of the operator command's numbering."""
OF_SYSTEMS = {"battery": (SOUND, OFF, STUCK, WRONG), "motor": (SOUND, OFF, STUCK, WRONG, SLOW)}
"""Failure types of units other than sensors; sensors support all."""


class Faults(NamedTuple):
    """Failure type of each unit."""

    gyro: tuple[int, ...] = (SOUND,)  # one for each inertial measurement unit
    accelerometer: tuple[int, ...] = (SOUND,)
    magnetometer: int = SOUND
    barometer: int = SOUND
    gps: int = SOUND
    distance_sensor: int = SOUND
    optical_flow: int = SOUND
    airspeed: int = SOUND
    battery: int = SOUND
    battery_charge: float = 0.0  # fraction that a wrong battery reports
    motors: tuple[int, ...] = ()  # one for each motor


SATELLITES, FIX_SATELLITES = "SIM_GPS_USED", 4  # parameter, and its minimum with a fix, as in PX4


def with_satellites(faults: Faults, values: Mapping[str, float], has_gps: bool) -> Faults:
    """Return the failures with GPS off if the parameters leave no fix.

    Args:
        faults: injected failures.
        values: parameters; SIM_GPS_USED may select too few satellites for a fix.
        has_gps: value of SYS_HAS_GPS at the start.
    """
    enough = values.get(SATELLITES, FIX_SATELLITES) >= FIX_SATELLITES  # absent from former logs
    return faults if enough and has_gps else faults._replace(gps=OFF)


def supported_types(unit: str) -> tuple[int, ...]:
    """Return the failure types that a unit supports."""
    return OF_SYSTEMS.get(unit, tuple(range(len(KINDS))))


def rejection_text(unit: str) -> str:
    """Return the message for a failure type that a unit does not support."""
    return f"{unit} can be {', '.join(KINDS[kind] for kind in supported_types(unit))}"
