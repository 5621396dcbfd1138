"""How far a flight is from what was asked: errors of the six axes while the motors are armed."""

from typing import Any

import numpy as np

from dynamics.kernel import kernel

TURN = 2.0 * np.pi
AXES = {"x": "m", "y": "m", "z": "m", "roll": "rad", "pitch": "rad", "yaw": "rad"}  # and their units

DEGREE = np.pi / 180.0  # [rad]


def shown(axis: str) -> tuple[str, float]:
    """The unit in which people are shown an axis, and how many of it are 1 m or 1 rad: angles in degrees."""
    return ("°", 1.0 / DEGREE) if AXES[axis] == "rad" else ("m", 1.0)


def roll_pitch_yaw(xyzw: np.ndarray) -> np.ndarray:
    """Roll, pitch, yaw [rad] of unit quaternions of shape (n, 4), shape (n, 3); yaw without jumps."""
    x, y, z, w = np.asarray(xyzw, dtype=float).T
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    if not (np.abs(np.diff(yaw)) < np.pi).all():
        yaw = np.unwrap(yaw)
    return np.column_stack([roll, pitch, yaw])


def errors(reference: np.ndarray, position: np.ndarray, attitude: np.ndarray, armed: np.ndarray) -> np.ndarray:
    """Reference minus truth of each axis [m], [rad], shape (k, 6), of the k rows with the motors armed.

    Args:
        reference: x, y, z [m], roll, pitch, yaw [rad], shape (n, 6).
        position: x, y, z [m], shape (n, 3).
        attitude: roll, pitch, yaw [rad], shape (n, 3).
        armed: shape (n,) of bool.
    """
    found = np.empty((np.count_nonzero(armed), len(AXES)))
    _errors(found, plain(reference), plain(position), plain(attitude), plain(armed, bool))
    return found


def plain(values: np.ndarray, kind: type = float) -> np.ndarray:
    """The same array laid out so that one compiled version serves all; a copy where it is not."""
    return np.require(values, kind, ("C", "W"))


@kernel
def _errors(found: Any, reference: Any, position: Any, attitude: Any, armed: Any) -> None:
    k = 0
    for row in range(len(armed)):
        if armed[row]:
            for i in range(3):
                found[k, i] = reference[row, i] - position[row, i]
                turn = reference[row, 3 + i] - attitude[row, i]
                found[k, 3 + i] = turn - TURN * np.rint(turn / TURN)
            k += 1


def rmse(errors: np.ndarray) -> dict[str, float]:
    """Root-mean-square error of each axis [m], [rad]; NaN where the motors were never armed."""
    values = np.sqrt(np.mean(errors**2, axis=0)) if len(errors) else np.full(len(AXES), np.nan)
    return dict(zip(AXES, map(float, values), strict=True))
