"""Quaternions w, x, y, z in arrays of shape (n, 4), body to world."""

import numpy as np

from lapwing.dynamics.constants import STANDARD_GRAVITY

SMALL = 1e-9  # [rad]
UPWARD = np.array([0.0, 0.0, STANDARD_GRAVITY])  # [m/s^2] world, specific force at rest


def from_xyzw(q: np.ndarray) -> np.ndarray:
    """Return quaternions of messages, which are x, y, z, w."""
    return q[..., [3, 0, 1, 2]]


def unit(q: np.ndarray) -> np.ndarray:
    """Return the normalised quaternions; NaN where the norm is 0."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return q / np.linalg.norm(q, axis=-1, keepdims=True)


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the quaternion products a b; that of an inverse and its rotation has no vector part."""
    aw, ax, ay, az = np.moveaxis(a, -1, 0)
    bw, bx, by, bz = np.moveaxis(b, -1, 0)
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            (aw * bx + ax * bw) + (ay * bz - az * by),
            (aw * by + ay * bw) + (az * bx - ax * bz),
            (aw * bz + az * bw) + (ax * by - ay * bx),
        ],
        axis=-1,
    )


def conjugate(q: np.ndarray) -> np.ndarray:
    """Return the inverse rotations."""
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def rotation_vector(q: np.ndarray) -> np.ndarray:
    """Return the rotation vectors [rad] of angle up to pi, shape (n, 3)."""
    q = q * np.where(q[..., :1] < 0.0, -1.0, 1.0)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, q[..., :1])
    return q[..., 1:] * np.where(sine > SMALL, angle / np.maximum(sine, SMALL), 2.0)


def from_vector(v: np.ndarray) -> np.ndarray:
    """Return the quaternions of rotation vectors [rad], shape (n, 3)."""
    angle = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.concatenate([np.cos(0.5 * angle), 0.5 * np.sinc(0.5 * angle / np.pi) * v], axis=-1)


def rotate(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return body vectors in world coordinates, shape (n, 3)."""
    t = 2.0 * np.cross(q[..., 1:], v)
    return v + q[..., :1] * t + np.cross(q[..., 1:], t)


def specific_force(q: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Return the specific force [m/s^2, body] of attitudes q (..., 4) and world accelerations (..., 3)."""
    return rotate(conjugate(q), acceleration + UPWARD)


def body_rate(q: np.ndarray, interval: np.ndarray) -> np.ndarray:
    """Return the mean body rate [rad/s] over the interval [s] before each sample, shape (n, 3); zero at the first."""
    rate = rotation_vector(product(conjugate(q[:-1]), q[1:])) / interval[1:, None]
    return np.concatenate([np.zeros((1, 3)), rate])


def from_ned_frd(q: np.ndarray) -> np.ndarray:
    """Convert attitudes of FRD body axes in NED to those of FLU body axes in ENU."""
    half = np.sqrt(0.5)
    return product(product(np.array([0.0, half, half, 0.0]), q), np.array([0.0, 1.0, 0.0, 0.0]))


def from_euler(angles: np.ndarray) -> np.ndarray:
    """Return the quaternions of roll, pitch and yaw [rad], shape (n, 3), rotations in the order yaw, pitch, roll."""
    roll, pitch, yaw = (0.5 * angles).T
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (np.cos, np.sin))
    return np.column_stack(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )


def to_euler(q: np.ndarray) -> np.ndarray:
    """Return roll, pitch and yaw [rad], shape (n, 3), of unit quaternions; inverse of `from_euler`."""
    w, x, y, z = q.T
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    return np.column_stack([roll, pitch, np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))])


def ned_to_enu(v: np.ndarray) -> np.ndarray:
    """Convert vectors from NED to ENU, shape (n, 3)."""
    return v[:, [1, 0, 2]] * [1.0, 1.0, -1.0]


def continuous(q: np.ndarray) -> np.ndarray:
    """Return the quaternions with continuous signs."""
    flips = np.cumprod(np.where(np.r_[1.0, np.sum(q[1:] * q[:-1], axis=1)] < 0.0, -1.0, 1.0))
    return q * flips[:, None]
