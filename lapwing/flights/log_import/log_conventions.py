"""Conventions that logs of several autopilots share: enumerations of MAVLink, pulses, and errors of their parsers."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from lapwing.dynamics.input_file import unreadable
from lapwing.flights.log_import.recording import Series
from lapwing.flights.rotation_arrays import from_euler, from_ned_frd, ned_to_enu, to_euler, unit
from lapwing.services.common.ports import IMUS

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


FLU = np.array([1.0, -1.0, -1.0])  # signs from FRD to FLU, and back
BODY = {
    "omega": FLU, "specific_force": FLU, "mag": FLU, "optical_flow": [1, -1, 1, -1, 1],
    **dict.fromkeys(IMUS, np.tile(FLU, 2)),
}  # fmt: skip


def in_enu_flu(quantity: str, series: Series) -> Series:
    """Return a series of a quantity in world ENU and body FLU, attitudes as quaternions.

    Args:
        quantity: see `Channels`.
        series: values in the axes whose names its `frame` contains, by default ENU and FLU. An attitude has four
            columns of a quaternion or three angles roll, pitch, yaw [rad].
    """
    axes, values = set(re.findall("[a-z]+", series.frame.lower())), series.values
    if quantity in ("attitude", "attitude_setpoint"):
        values = from_euler(values) if values.shape[1] == 3 else values
        values = from_ned_frd(values) if "ned" in axes else values
        values = to_euler(unit(values)) if quantity == "attitude_setpoint" else values
    elif quantity in BODY and "frd" in axes:
        values = values * BODY[quantity]
    elif quantity in ("position", "velocity", "gps_velocity") and "ned" in axes:
        values = ned_to_enu(values)
    elif quantity == "setpoint" and "ned" in axes:
        vectors = [ned_to_enu(values[:, k : k + 3]) for k in (0, 3, 6)]
        heading = np.arctan2(np.cos(values[:, 9]), np.sin(values[:, 9]))  # from east, counterclockwise
        values = np.column_stack([*vectors, heading, -values[:, 10]])
    return series if values is series.values else replace(series, values=values)
