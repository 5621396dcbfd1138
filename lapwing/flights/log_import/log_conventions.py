"""Conventions that logs of several autopilots share: enumerations of MAVLink, pulses, and errors of their parsers."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from lapwing.dynamics.input_file import unreadable

FIX = 3  # GPS_FIX_TYPE of a fix in three dimensions
PULSE_LOW, PULSE_HIGH = 1000.0, 2000.0  # [us] of motors at rest and at full throttle
DIRECTIONS = {25: "down", 24: "up", 0: "forward", 12: "forward"}  # MAV_SENSOR_ORIENTATION of a range sensor


class LogError(ValueError):
    """Known fault of a log, without its path."""


@contextmanager
def parsing(path: Path, name: str, expected: str) -> Iterator[None]:
    """Turn the errors of a parser, which are of many types, into one line that begins with the path."""
    try:
        yield
    except LogError as error:
        raise ValueError(f"{path}: {error}") from None
    except OSError as error:
        raise unreadable(path, error, expected) from None
    except Exception:  # parsers raise many types
        raise ValueError(f"{path}: is not a readable {name}; expected {expected}") from None


def shares(pulses: np.ndarray, low: float = PULSE_LOW, high: float = PULSE_HIGH) -> np.ndarray:
    """Convert pulses [us] to shares of full throttle."""
    return (pulses - low) / (high - low)


def out_of_range(distance: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[str, np.ndarray]:
    """Return the doubt about readings beyond the limits of a range sensor, if it states them."""
    return "out of range", ((distance < low) | (distance > high)) & (high > low)


def direction(orientation: float) -> str:
    """Return the direction in which a range sensor looks."""
    return DIRECTIONS.get(int(orientation), "aside")
