"""Rotations as matrices (nine floats in row order) and rotation vectors [rad]: the closed forms on SO(3)."""

from typing import NamedTuple

from lapwing.dynamics.lie import quaternion
from lapwing.dynamics.lie.ratios import cosine_ratio, cotangent_ratio, cubic_ratio, sine_ratio
from lapwing.dynamics.vector import add, cross, dot, matmul, scale, transpose
from lapwing.kernels import always_inline
from lapwing.kernels.state_tree import MANIFOLDS, Manifold


class Rotation(NamedTuple):
    """Rotation matrix in row order; as a state leaf, an attitude on SO(3) with tangent omega_body [rad/s]."""

    m00: float
    m01: float
    m02: float
    m10: float
    m11: float
    m12: float
    m20: float
    m21: float
    m22: float


@always_inline
def hat(v):
    """Return the skew matrix with hat(v) a = v x a."""
    return (0.0, -v[2], v[1], v[2], 0.0, -v[0], -v[1], v[0], 0.0)


@always_inline
def vee(m):
    """Return the inverse of `hat` on the skew part of m."""
    return (0.5 * (m[7] - m[5]), 0.5 * (m[2] - m[6]), 0.5 * (m[3] - m[1]))


@always_inline
def exp(v):
    """Return the rotation matrix of the rotation vector v (theory, eq. (5.6))."""
    square = dot(v, v)
    s, c = sine_ratio(square), cosine_ratio(square)
    sx, sy, sz = s * v[0], s * v[1], s * v[2]
    cx, cy, cz = c * v[0], c * v[1], c * v[2]
    xx, yy, zz, xy, xz, yz = cx * v[0], cy * v[1], cz * v[2], cx * v[1], cx * v[2], cy * v[2]
    return Rotation(
        1.0 - (yy + zz), xy - sz, xz + sy, xy + sz, 1.0 - (xx + zz), yz - sx, xz - sy, yz + sx, 1.0 - (xx + yy)
    )


@always_inline
def turn(v, a):
    """Return exp(hat(v)) a without the matrix."""
    square = dot(v, v)
    across = cross(v, a)
    return add(a, add(scale(sine_ratio(square), across), scale(cosine_ratio(square), cross(v, across))))


@always_inline
def log(m):
    """Return the rotation vector, at most pi long, via the quaternion: accurate near zero and near pi."""
    return quaternion.log(quaternion.from_matrix(m))


@always_inline
def dexp(u, v):
    """Return the derivative of the exponential: exp(u)' = hat(dexp(u, u')) exp(u) (theory, eq. (5.7))."""
    square = dot(u, u)
    across = cross(u, v)
    return add(v, add(scale(cosine_ratio(square), across), scale(cubic_ratio(square), cross(u, across))))


@always_inline
def dexpinv(u, v):
    """Return the inverse of `dexp(u, .)`; singular at |u| = 2 pi (theory, eq. (5.8))."""
    across = cross(u, v)
    return add(v, add(scale(-0.5, across), scale(cotangent_ratio(u), cross(u, across))))


@always_inline
def determinant(m):
    """Return the determinant of a 3x3 matrix: +1 for a rotation, -1 for a reflection."""
    return dot((m[0], m[1], m[2]), cross((m[3], m[4], m[5]), (m[6], m[7], m[8])))


@always_inline
def _polish(m):
    """Return one Newton step towards the polar factor: m (3 I - transpose(m) m) / 2; it squares the defect."""
    g = matmul(transpose(m), m)
    return matmul(m, (
        1.5 - 0.5 * g[0], -0.5 * g[1], -0.5 * g[2],
        -0.5 * g[3], 1.5 - 0.5 * g[4], -0.5 * g[5],
        -0.5 * g[6], -0.5 * g[7], 1.5 - 0.5 * g[8],
    ))  # fmt: skip


@always_inline
def normalise(m):
    """Return the rotation matrix nearest to m, for m within 0.1 of one."""
    return Rotation(*_polish(_polish(_polish(_polish(m)))))


@always_inline
def retract(m, v):
    """Return m exp(hat(v)): m rotated by v in body coordinates."""
    # one Newton step, otherwise the rounding errors of many equal steps accumulate
    return Rotation(*_polish(matmul(m, exp(v))))


@always_inline
def embed(m, omega_body):
    """Return the derivative of the nine numbers: m hat(omega_body)."""
    return matmul(m, hat(omega_body))


MANIFOLDS[Rotation] = Manifold(retract, embed, normalise, quaternion.bracket, quaternion.transport)
