"""Attitude as a unit quaternion (w, x, y, z) that takes body coordinates to world coordinates.

The tangent at an attitude is the angular velocity in body coordinates, omega_body [rad/s], so that
q' = q * (0, omega_body) / 2 (theory, eq. (5.12)); q and -q are the same attitude.
"""

from typing import NamedTuple

from lapwing.kernels import always_inline, math
from lapwing.kernels.state_tree import MANIFOLDS, Manifold


class Quaternion(NamedTuple):
    """Unit quaternion; as a state leaf, an attitude on SO(3)."""

    w: float
    x: float
    y: float
    z: float


NO_ROTATION = Quaternion(1.0, 0.0, 0.0, 0.0)


@always_inline
def multiply(p, q):
    """Return the Hamilton product p * q: first q, then p."""
    return Quaternion(
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    )


@always_inline
def conjugate(q):
    """Return the opposite rotation."""
    return Quaternion(q[0], -q[1], -q[2], -q[3])


@always_inline
def rotation_matrix(q):
    """Return R_world_body of an attitude, nine floats in row order."""
    x2, y2, z2 = q[1] + q[1], q[2] + q[2], q[3] + q[3]
    xx, yy, zz = q[1] * x2, q[2] * y2, q[3] * z2
    xy, xz, yz = q[1] * y2, q[1] * z2, q[2] * z2
    wx, wy, wz = q[0] * x2, q[0] * y2, q[0] * z2
    return (1.0 - (yy + zz), xy - wz, xz + wy, xy + wz, 1.0 - (xx + zz), yz - wx, xz - wy, yz + wx, 1.0 - (xx + yy))


@always_inline
def rotate(q, v_body):
    """Return R_world_body v_body. For several vectors use `rotation_matrix` once and `vector.apply`."""
    tx = 2.0 * (q[2] * v_body[2] - q[3] * v_body[1])
    ty = 2.0 * (q[3] * v_body[0] - q[1] * v_body[2])
    tz = 2.0 * (q[1] * v_body[1] - q[2] * v_body[0])
    return (
        v_body[0] + q[0] * tx + q[2] * tz - q[3] * ty,
        v_body[1] + q[0] * ty + q[3] * tx - q[1] * tz,
        v_body[2] + q[0] * tz + q[1] * ty - q[2] * tx,
    )


@always_inline
def rotate_back(q, v_world):
    """Return transpose(R_world_body) v_world."""
    return rotate(conjugate(q), v_world)


@always_inline
def exp(v):
    """Return the quaternion of the rotation vector v [rad] (theory, eq. (5.9))."""
    square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    if square < 2.5e-3:  # |v| < 0.05: the first omitted terms are below 1e-17
        s = 0.5 + square * (-1.0 / 48.0 + square * (1.0 / 3840.0 - square / 645120.0))
        c = 1.0 + square * (-0.125 + square * (1.0 / 384.0 - square / 46080.0))
    else:
        angle = math.sqrt(square)
        sine, c = math.sincos(0.5 * angle)
        s = sine / angle
    return Quaternion(c, s * v[0], s * v[1], s * v[2])


@always_inline
def log(q):
    """Return the rotation vector [rad] of a unit quaternion, the branch with angle at most pi (eq. (5.10))."""
    sine = math.sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    # atan2 keeps full relative accuracy both near the identity (sine -> 0) and near pi (w -> 0)
    half = math.atan2(sine, abs(q[0]))
    k = 2.0 if sine < 1e-150 else 2.0 * half / sine
    k = -k if q[0] < 0.0 else k
    return (k * q[1], k * q[2], k * q[3])


@always_inline
def from_matrix(m):
    """Return the quaternion (w >= 0) of a rotation matrix, by the largest of four candidates (eq. (5.11))."""
    trace = m[0] + m[4] + m[8]
    if trace >= m[0] and trace >= m[4] and trace >= m[8]:
        q = Quaternion(1.0 + trace, m[7] - m[5], m[2] - m[6], m[3] - m[1])
    elif m[0] >= m[4] and m[0] >= m[8]:
        q = Quaternion(m[7] - m[5], 1.0 + m[0] - m[4] - m[8], m[1] + m[3], m[2] + m[6])
    elif m[4] >= m[8]:
        q = Quaternion(m[2] - m[6], m[1] + m[3], 1.0 + m[4] - m[0] - m[8], m[5] + m[7])
    else:
        q = Quaternion(m[3] - m[1], m[2] + m[6], m[5] + m[7], 1.0 + m[8] - m[0] - m[4])
    n = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    k = -1.0 / n if q[0] < 0.0 else 1.0 / n
    return Quaternion(k * q[0], k * q[1], k * q[2], k * q[3])


@always_inline
def from_roll_pitch_yaw(roll, pitch, yaw):
    """Return the attitude of yaw about z, then pitch about the new y, then roll about the new x [rad].

    In FLU a positive pitch is nose down.
    """
    sr, cr = math.sincos(0.5 * roll)
    sp, cp = math.sincos(0.5 * pitch)
    sy, cy = math.sincos(0.5 * yaw)
    return Quaternion(
        cy * cp * cr + sy * sp * sr,
        cy * cp * sr - sy * sp * cr,
        cy * sp * cr + sy * cp * sr,
        sy * cp * cr - cy * sp * sr,
    )


@always_inline
def to_roll_pitch_yaw(q):
    """Return (roll, pitch, yaw) [rad], inverse of `from_roll_pitch_yaw`; pitch in [-pi/2, pi/2]."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    r21, r22 = 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
    r10, r00 = 2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z)
    # atan2 instead of asin(-R20): accurate up to the vertical
    pitch = math.atan2(2.0 * (w * y - x * z), math.sqrt(r21 * r21 + r22 * r22))
    return (math.atan2(r21, r22), pitch, math.atan2(r10, r00))


@always_inline
def retract(q, v):
    """Return q exp(v): q rotated by the rotation vector v in body coordinates [rad]."""
    r = multiply(q, exp(v))
    # first-order normalisation, otherwise the rounding errors of many equal steps accumulate in the length
    k = 1.5 - 0.5 * ((r[0] * r[0] + r[1] * r[1]) + (r[2] * r[2] + r[3] * r[3]))
    return Quaternion(k * r[0], k * r[1], k * r[2], k * r[3])


@always_inline
def embed(q, omega_body):
    """Return the derivative of the four numbers: q * (0, omega_body) / 2."""
    x, y, z = 0.5 * omega_body[0], 0.5 * omega_body[1], 0.5 * omega_body[2]
    return (
        -q[1] * x - q[2] * y - q[3] * z,
        q[0] * x + q[2] * z - q[3] * y,
        q[0] * y - q[1] * z + q[3] * x,
        q[0] * z + q[1] * y - q[2] * x,
    )


@always_inline
def normalise(q):
    """Return q / |q|; near unit length the first-order term of the root is exact to round-off and needs no division."""
    square = (q[0] * q[0] + q[1] * q[1]) + (q[2] * q[2] + q[3] * q[3])
    excess = square - 1.0
    if abs(excess) < 1e-8:  # 3/8 excess^2 < 4e-17
        k = 1.0 - 0.5 * excess
    else:
        k = 1.0 / math.sqrt(square)
    return Quaternion(k * q[0], k * q[1], k * q[2], k * q[3])


@always_inline
def bracket(u, v):
    """Return the bracket with the sign for right tangents (theory, eq. (5.3)): -(u x v)."""
    return (u[2] * v[1] - u[1] * v[2], u[0] * v[2] - u[2] * v[0], u[1] * v[0] - u[0] * v[1])


@always_inline
def transport(u, v):
    """Transport a tangent from q exp(u) back to q: half the rotation (theory, eq. (5.20))."""
    return rotate(exp((0.5 * u[0], 0.5 * u[1], 0.5 * u[2])), v)


MANIFOLDS[Quaternion] = Manifold(retract, embed, normalise, bracket, transport)
