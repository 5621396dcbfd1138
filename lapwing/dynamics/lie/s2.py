"""Directions: unit vectors, on which rotations act from the left.

The tangent at a direction q is an angular velocity omega [rad/s] in the frame of q, orthogonal to q, so that
q' = omega x q (theory, eq. (5.14)).
"""

from typing import NamedTuple

from lapwing.dynamics.lie.so3 import turn
from lapwing.dynamics.vector import cross, dot, norm, scale
from lapwing.kernels import always_inline
from lapwing.kernels.state_tree import MANIFOLDS, Manifold


class Direction(NamedTuple):
    """Unit vector; as a state leaf, a point of S^2."""

    x: float
    y: float
    z: float


@always_inline
def retract(q, v):
    """Return exp(hat(v)) q: the direction rotated by the rotation vector v [rad] (theory, eq. (5.15))."""
    r = turn(v, q)
    # first-order normalisation, otherwise the rounding errors of many equal steps accumulate in the length
    return Direction(*scale(1.5 - 0.5 * dot(r, r), r))


@always_inline
def normalise(q):
    """Return q / |q|."""
    return Direction(*scale(1.0 / norm(q), q))


@always_inline
def embed(q, omega):
    """Return the derivative of the three numbers: omega x q."""
    return cross(omega, q)


@always_inline
def transport(u, v):
    """Transport a tangent from exp(u) q back to q, with u orthogonal to q: rotate it back by u (eq. (5.21))."""
    return turn(scale(-1.0, u), v)


# rotations act on directions from the left: [u, v] = u x v
MANIFOLDS[Direction] = Manifold(retract, embed, normalise, cross, transport)
