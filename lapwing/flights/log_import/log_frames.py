"""Conversion of a log's quantities from the axes that it names to world ENU and body FLU, once for all formats."""

import re
from dataclasses import replace

import numpy as np

from lapwing.flights.log_import.recording import Series
from lapwing.flights.rotation_arrays import from_euler, from_ned_frd, ned_to_enu, to_euler, unit

FLU = np.array([1.0, -1.0, -1.0])  # signs from FRD to FLU, and back
BODY = {"omega": FLU, "specific_force": FLU, "mag": FLU, "imu": np.tile(FLU, 2), "optical_flow": [1, -1, 1, -1, 1]}


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
