"""How far a flight is from what was asked: errors of the six axes while the motors are armed."""

import numpy as np
from scipy.spatial.transform import Rotation

TURN = 2.0 * np.pi
AXES = {"x": "m", "y": "m", "z": "m", "roll": "rad", "pitch": "rad", "yaw": "rad"}  # and their units

DEGREE = np.pi / 180.0  # [rad]


def shown(axis: str) -> tuple[str, float]:
    """The unit in which people are shown an axis, and how many of it are 1 m or 1 rad: angles in degrees."""
    return ("°", 1.0 / DEGREE) if AXES[axis] == "rad" else ("m", 1.0)


def roll_pitch_yaw(xyzw: np.ndarray) -> np.ndarray:
    """Roll, pitch, yaw [rad] of unit quaternions of shape (n, 4), shape (n, 3); yaw without jumps."""
    yaw_pitch_roll = Rotation.from_quat(xyzw).as_euler("ZYX")
    yaw_pitch_roll[:, 0] = np.unwrap(yaw_pitch_roll[:, 0])
    return yaw_pitch_roll[:, ::-1]


def errors(reference: np.ndarray, position: np.ndarray, attitude: np.ndarray, armed: np.ndarray) -> np.ndarray:
    """Reference minus truth of each axis [m], [rad], shape (k, 6), of the k rows with the motors armed.

    Args:
        reference: x, y, z [m], roll, pitch, yaw [rad], shape (n, 6).
        position: x, y, z [m], shape (n, 3).
        attitude: roll, pitch, yaw [rad], shape (n, 3).
        armed: shape (n,) of bool.
    """
    turn = reference[:, 3:] - attitude
    turn -= TURN * np.round(turn / TURN)
    return np.column_stack([reference[:, :3] - position, turn])[armed]


def rmse(errors: np.ndarray) -> dict[str, float]:
    """Root-mean-square error of each axis [m], [rad]; NaN where the motors were never armed."""
    values = np.sqrt(np.mean(errors**2, axis=0)) if len(errors) else np.full(len(AXES), np.nan)
    return dict(zip(AXES, map(float, values), strict=True))
