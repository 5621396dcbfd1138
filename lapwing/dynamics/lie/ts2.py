"""The tangent bundle of the sphere: a direction q with its angular velocity omega, q . omega = 0.

SE(3) acts on it transitively from the left, (C, c) (q, omega) = (C q, C omega + c x C q), so that both constraints hold
to round-off with any step (theory, eqs. (5.22) to (5.24); the action of the cooperative load).
"""

from typing import NamedTuple

from lapwing.dynamics.lie import so3
from lapwing.dynamics.lie.se3 import adjoint, commutator, exp
from lapwing.dynamics.vector import Vec3, add, cross, dot, scale, subtract
from lapwing.kernels import always_inline, math
from lapwing.kernels.state_tree import MANIFOLDS, Manifold


class Swing(NamedTuple):
    """Direction and its angular velocity in one frame; as a state leaf, a point of TS^2."""

    direction: Vec3
    omega: Vec3  # [rad/s], orthogonal to direction


@always_inline
def tangent(x, acceleration):
    """Return the algebra element (mu_1, mu_2) of omega' = acceleration [rad/s^2], normal to the direction.

    See theory, eq. (5.24).
    """
    return x[1], cross(x[0], acceleration)


@always_inline
def act(rotation, shift, x):
    """Return the action of the rigid motion (exp(rotation), shift) on x (theory, eq. (5.22))."""
    direction = so3.turn(rotation, x[0])
    return Swing(direction, add(so3.turn(rotation, x[1]), cross(shift, direction)))


@always_inline
def _polish(x):
    """Restore |q| = 1 and q . omega = 0 to first order, so that the rounding of many steps does not add up."""
    q = scale(1.5 - 0.5 * dot(x[0], x[0]), x[0])
    return Swing(q, subtract(x[1], scale(dot(q, x[1]), q)))


@always_inline
def retract(x, mu):
    """Return exp(mu) x with the exponential of SE(3): rotation exp(mu_1), shift dexp(mu_1, mu_2)."""
    return _polish(act(mu[0], so3.dexp(mu[0], mu[1]), x))


@always_inline
def embed(x, mu):
    """Return the derivative of the six numbers (theory, eq. (5.23))."""
    return cross(mu[0], x[0]), add(cross(mu[0], x[1]), cross(mu[1], x[0]))


@always_inline
def normalise(x):
    """Normalise the direction and make the angular velocity orthogonal to it."""
    q = scale(1.0 / math.sqrt(dot(x[0], x[0])), x[0])
    return Swing(q, subtract(x[1], scale(dot(q, x[1]), q)))


@always_inline
def bracket(u, v):
    """Return [u, v] of (rotation, translation) pairs; rotations act from the left."""
    translation, rotation = commutator((u[1], u[0]), (v[1], v[0]))
    return rotation, translation


@always_inline
def transport(u, v):
    """Transport a tangent from exp(u) x back to x: Ad of exp(-u/2) in SE(3), acting from the left (eq. (5.20))."""
    translation, rotation = adjoint(exp((scale(-0.5, u[1]), scale(-0.5, u[0]))), (v[1], v[0]))
    return rotation, translation


MANIFOLDS[Swing] = Manifold(retract, embed, normalise, bracket, transport)
