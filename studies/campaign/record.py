"""What is kept of a flight of a campaign."""

from typing import NamedTuple

import numpy as np


class FlightRecord(NamedTuple):
    """What is kept of a flight, a row a tick: arrays of shape (n, ...)."""

    position_world: np.ndarray  # (n, 3) [m]
    attitude: np.ndarray  # (n, 4) wxyz
    velocity_world: np.ndarray  # (n, 3) [m/s]
    omega_body: np.ndarray  # (n, 3) [rad/s]
    power: np.ndarray  # (n,) [W] electrical
    in_contact: np.ndarray  # (n,) bool: any foot touches the ground
    setpoint_world: np.ndarray  # (n, 4) position [m] and yaw [rad]
    tilt_reference: np.ndarray  # (n, 2) roll and pitch that the inner loops follow [rad]
    motor_voltage: np.ndarray  # (n, 4) [V] asked for
    armed: np.ndarray  # (n,) bool
    estimated_world: np.ndarray  # (n, 3) [m]
    estimated_attitude: np.ndarray  # (n, 4) wxyz
    position_std: np.ndarray  # (n, 3) [m] world
    health: np.ndarray  # (n,)


class Flown(NamedTuple):
    """A flight: its record, and how it ended."""

    record: FlightRecord
    finite: bool  # all numbers to the end
    finished: bool  # the mission ended before the run


_WIDTH = {"attitude": 4, "setpoint_world": 4, "tilt_reference": 2, "motor_voltage": 4, "estimated_attitude": 4}
_FLAT = {"power": float, "in_contact": bool, "armed": bool, "health": int}


def blank(ticks: int) -> FlightRecord:
    """A record of so many rows, all zero."""
    columns = {}
    for name in FlightRecord._fields:
        kind = _FLAT.get(name)
        columns[name] = np.zeros(ticks, kind) if kind else np.zeros((ticks, _WIDTH.get(name, 3)))
    return FlightRecord(**columns)
