"""Failures that an operator may inject, as MAVLink's failure injection names them: which unit, and what is wrong."""

from typing import NamedTuple

KINDS = ("sound", "off", "stuck", "garbage", "wrong", "slow", "delayed", "intermittent")
"""What may be wrong with a unit; numbered as MAVLink's FAILURE_TYPE."""
SOUND, OFF, STUCK, GARBAGE, WRONG, SLOW, DELAYED, INTERMITTENT = range(len(KINDS))
UNITS = (
    "gyro", "accelerometer", "magnetometer", "barometer", "gps", "distance_sensor", "battery", "motor", "optical_flow",
    "airspeed",
)  # fmt: skip
"""In the order in which an operator's command counts them."""
OF_SYSTEMS = {"battery": (SOUND, OFF, STUCK, WRONG), "motor": (SOUND, OFF, STUCK, WRONG, SLOW)}
"""What may be wrong with a unit that is no sensor; with a sensor, everything."""


class Faults(NamedTuple):
    """What is wrong now."""

    gyro: int = SOUND
    accelerometer: int = SOUND
    magnetometer: int = SOUND
    barometer: int = SOUND
    gps: int = SOUND
    distance_sensor: int = SOUND
    optical_flow: int = SOUND
    airspeed: int = SOUND
    battery: int = SOUND
    battery_charge: float = 0.0  # fraction that a wrong battery reports
    motors: tuple[int, ...] = ()  # one for each


def possible(unit: str) -> tuple[int, ...]:
    """What may be wrong with a unit."""
    return OF_SYSTEMS.get(unit, tuple(range(len(KINDS))))


def refusal(unit: str) -> str:
    """What to tell somebody who asks for a failure that a unit does not know."""
    return f"{unit} can be {', '.join(KINDS[kind] for kind in possible(unit))}"
