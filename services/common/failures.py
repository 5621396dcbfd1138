"""Failures that an operator may inject, as MAVLink's failure injection names them: which unit, and what is wrong."""

from typing import NamedTuple

SOUND, OFF, STUCK, WRONG, SLOW = range(5)  # what is wrong with a unit
UNITS = ("gyro", "accelerometer", "magnetometer", "barometer", "gps", "sonar", "battery", "motor")
"""In the order in which an operator's command counts them."""


class Faults(NamedTuple):
    """What is wrong now."""

    gyro: int = SOUND
    accelerometer: int = SOUND
    magnetometer: int = SOUND
    barometer: int = SOUND
    gps: int = SOUND
    sonar: int = SOUND
    battery: int = SOUND
    motors: int = 0  # bit k: motor k + 1 is off
