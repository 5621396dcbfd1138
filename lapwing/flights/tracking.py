"""Tracking errors of the six axes while the motors are armed."""

import math
from typing import Any, NamedTuple

import numpy as np

from lapwing.kernels import always_inline, kernel

TURN = 2.0 * np.pi
AXES = {"x": "m", "y": "m", "z": "m", "roll": "rad", "pitch": "rad", "yaw": "rad"}  # units by axis

DEGREE = np.pi / 180.0  # [rad]


def unit_and_factor(axis: str) -> tuple[str, float]:
    """Return the display unit of an axis, and its factor from m or rad: angles in degrees."""
    return ("°", 1.0 / DEGREE) if AXES[axis] == "rad" else ("m", 1.0)


def digits(value: float) -> str:
    """Return an error with four decimals, or three significant digits if it is small: 1.2345, 0.000214, 3.27e-09, 0."""
    if not 0.0 < abs(value) < 1e-2:
        return f"{value:.4f}" if value else "0"
    return f"{value:.{2 - math.floor(math.log10(abs(value)))}f}" if abs(value) >= 1e-6 else f"{value:.2e}"


def roll_pitch_yaw(xyzw: np.ndarray) -> np.ndarray:
    """Return roll, pitch, yaw [rad], shape (n, 3), of unit quaternions (n, 4); yaw without jumps."""
    result, cosines = np.empty((3, len(xyzw))), np.empty((2, len(xyzw)))
    _sines(result, cosines, plain(np.transpose(xyzw)))
    roll, pitch, yaw = result
    np.arctan2(roll, cosines[0], out=roll)  # numpy evaluates angles in SIMD vectors, compiled code one by one
    np.arcsin(pitch, out=pitch)
    np.arctan2(yaw, cosines[1], out=yaw)
    if not (np.abs(np.diff(yaw)) < np.pi).all():
        yaw[:] = np.unwrap(yaw)
    return result.T


@kernel
def _sines(out: Any, cosines: Any, xyzw: Any) -> None:
    """Compute sines of roll, pitch, yaw (3, n), cosines of roll, yaw (2, n), up to a factor, of quaternions (4, n)."""
    for k in range(xyzw.shape[1]):
        x, y, z, w = xyzw[0, k], xyzw[1, k], xyzw[2, k], xyzw[3, k]
        out[0, k], cosines[0, k] = 2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)
        sine = 2.0 * (w * y - z * x)
        out[1, k] = np.sign(sine) if abs(sine) > 1.0 else sine
        out[2, k], cosines[1, k] = 2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)


def errors(reference: np.ndarray, position: np.ndarray, attitude: np.ndarray, armed: np.ndarray) -> np.ndarray:
    """Return reference minus truth of each axis [m], [rad], shape (k, 6), in the k rows with armed motors.

    Args:
        reference: x, y, z [m], roll, pitch, yaw [rad], shape (n, 6).
        position: x, y, z [m], shape (n, 3).
        attitude: roll, pitch, yaw [rad], shape (n, 3).
        armed: True where the motors are armed, shape (n,).
    """
    result = np.empty((np.count_nonzero(armed), len(AXES)))
    _errors(result, plain(reference), plain(position), plain(attitude), plain(armed, bool))
    return result


def plain(values: np.ndarray, kind: type = float) -> np.ndarray:
    """Return a contiguous array, copied if necessary, so that one compiled version serves all inputs."""
    return np.require(values, kind, ("C", "W"))


def strided_view(values: np.ndarray) -> np.ndarray:
    """Return a read-only view with strides like those of port rows, copied if necessary, so that one compiled version
    serves all inputs."""
    result = np.asarray(values, float)
    if result.flags.contiguous or not result.flags.aligned:
        result = np.empty((*result.shape, 2))[..., 0]
        result[...] = values
    result = result.view()
    result.flags.writeable = False
    return result


@always_inline
def _turn(desired: float, actual: float) -> float:
    """Return the shortest rotation from one angle to another [rad]."""
    turn = desired - actual
    return turn if abs(turn) <= 0.5 * TURN else turn - TURN * np.rint(turn / TURN)


@kernel
def _errors(out: Any, reference: Any, position: Any, attitude: Any, armed: Any) -> None:
    k = 0
    for row in range(len(armed)):
        if armed[row]:
            for i in range(3):
                out[k, i] = reference[row, i] - position[row, i]
                out[k, 3 + i] = _turn(reference[row, 3 + i], attitude[row, i])
            k += 1


class Reference(NamedTuple):
    """Reference of the six axes at n times."""

    position: np.ndarray  # x, y, z [m], shape (n, 3)
    roll_pitch: np.ndarray  # [rad], shape (n, 2) or more
    yaw: np.ndarray  # [rad], shape (n,)


def rmse(reference: Reference, position: np.ndarray, attitude: np.ndarray, armed: np.ndarray) -> dict[str, float]:
    """Return the root-mean-square error of each axis [m], [rad] while armed, or NaN. See `errors` for arguments."""
    desired = Reference(*(strided_view(values) for values in reference))
    result = _mean_squares(*desired, strided_view(position), plain(np.transpose(attitude)), plain(armed, bool))
    return dict(zip(AXES, map(math.sqrt, result), strict=True))


@kernel
def _mean_squares(
    desired: Any, roll_pitch: Any, heading: Any, position: Any, attitude: Any, armed: Any
) -> tuple[float, float, float, float, float, float]:
    rows = 0
    x = y = z = roll = pitch = yaw = 0.0
    for row in range(len(armed)):
        if armed[row]:
            rows += 1
            x += (desired[row, 0] - position[row, 0]) ** 2
            y += (desired[row, 1] - position[row, 1]) ** 2
            z += (desired[row, 2] - position[row, 2]) ** 2
            roll += _turn(roll_pitch[row, 0], attitude[0, row]) ** 2
            pitch += _turn(roll_pitch[row, 1], attitude[1, row]) ** 2
            yaw += _turn(heading[row], attitude[2, row]) ** 2
    n = rows if rows else np.nan
    return x / n, y / n, z / n, roll / n, pitch / n, yaw / n


def reach(desired: np.ndarray, position: np.ndarray, armed: np.ndarray) -> tuple[float, float]:
    """Return the largest distance of the position from its reference while armed [m], and the largest overshoot beyond
    the extremes of the reference along any axis [m], negative if none is reached.

    Args:
        desired: reference [m], shape (n, 3).
        position: position [m], shape (n, 3).
        armed: True where the motors are armed, shape (n,).
    """
    return _reach(strided_view(desired), strided_view(position), plain(armed, bool))


@kernel
def _reach(desired: Any, position: Any, armed: Any) -> tuple[float, float]:
    squares, away = 0.0, 0.0
    along_x = along_y = along_z = (-np.inf, -np.inf, -np.inf, -np.inf)
    for row in range(len(armed)):
        if armed[row]:
            x, y = desired[row, 0] - position[row, 0], desired[row, 1] - position[row, 1]
            z = desired[row, 2] - position[row, 2]
            square = x * x + y * y + z * z
            squares, away = squares + square, _greater(away, square)
            along_x = _extend(along_x, position[row, 0], desired[row, 0])
            along_y = _extend(along_y, position[row, 1], desired[row, 1])
            along_z = _extend(along_z, position[row, 2], desired[row, 2])
    if squares != squares:  # NaN, which comparisons skip
        return np.nan, np.nan
    return np.sqrt(away), _greater(_beyond(along_x), _greater(_beyond(along_y), _beyond(along_z)))


Extremes = tuple[float, float, float, float]  # greatest x and -x of the position; of the reference


@always_inline
def _extend(extremes: Extremes, actual: float, desired: float) -> Extremes:
    """Return the extremes extended by another x."""
    return (
        _greater(extremes[0], actual), _greater(extremes[1], -actual),
        _greater(extremes[2], desired), _greater(extremes[3], -desired),
    )  # fmt: skip


@always_inline
def _beyond(extremes: Extremes) -> float:
    """Return the overshoot of the positions beyond the reference."""
    return _greater(extremes[0] - extremes[2], extremes[1] - extremes[3])


@always_inline
def _greater(a: float, b: float) -> float:
    """Return the greater of two numbers."""
    return a if a > b else b


def total(values: np.ndarray) -> float:
    """Return the sum of all numbers (n, k)."""
    return _total(strided_view(values))


@kernel
def _total(values: Any) -> float:
    result = 0.0
    for row in range(values.shape[0]):
        for k in range(values.shape[1]):
            result += values[row, k]
    return result
