"""Rigid motions: position and attitude, with the twist (v_body, omega_body) as tangent.

A pair (translation, rotation) of vectors is an element of se(3); its exponential is a screw motion.
"""

from typing import NamedTuple

from lapwing.dynamics.lie import quaternion, so3
from lapwing.dynamics.lie.quaternion import Quaternion, rotate
from lapwing.dynamics.lie.ratios import (
    cosine_ratio,
    cosine_slope,
    cotangent_ratio,
    cotangent_slope,
    cubic_ratio,
    cubic_slope,
)
from lapwing.dynamics.vector import Vec3, add, cross, dot, scale
from lapwing.kernels import always_inline
from lapwing.kernels.state_tree import MANIFOLDS, Manifold


class Pose(NamedTuple):
    """Frame of a rigid body; as a state leaf, a point of SE(3)."""

    position: Vec3  # [m] world
    attitude: Quaternion  # body to world


@always_inline
def exp(u):
    """Return the rigid motion of u = (translation [m], rotation [rad]) (theory, eq. (5.16))."""
    return Pose(so3.dexp(u[1], u[0]), quaternion.exp(u[1]))


@always_inline
def log(g):
    """Return (translation, rotation) of a rigid motion, inverse of `exp` for rotations below pi."""
    rotation = quaternion.log(g[1])
    return so3.dexpinv(rotation, g[0]), rotation


@always_inline
def adjoint(g, u):
    """Return Ad_g u, with g exp(u) = exp(Ad_g u) g (theory, eq. (5.17))."""
    rotation = rotate(g[1], u[1])
    return add(rotate(g[1], u[0]), cross(g[0], rotation)), rotation


@always_inline
def commutator(u, v):
    """Return [u, v] in se(3): ad_u v."""
    return add(cross(u[1], v[0]), cross(u[0], v[1])), cross(u[1], v[1])


@always_inline
def _along(linear, quadratic, quadratic_slope, linear_slope, u, v):
    """Return the derivative along u[0] of linear w x v + quadratic w x (w x v) at w = u[1] (theory, eq. (5.19))."""
    b, w = u[0], u[1]
    doubled = 2.0 * dot(b, w)
    wv, bv = cross(w, v), cross(b, v)
    first = add(scale(linear, bv), scale(doubled * linear_slope, wv))
    second = add(scale(quadratic, add(cross(b, wv), cross(w, bv))), scale(doubled * quadratic_slope, cross(w, wv)))
    return add(first, second)


@always_inline
def dexp(u, v):
    """Return dexp(u, v) on se(3), with exp(u)' = (dexp(u, u'))^ exp(u) (theory, eq. (5.19))."""
    square = dot(u[1], u[1])
    c, d = cosine_ratio(square), cubic_ratio(square)
    coupling = _along(c, d, cubic_slope(square), cosine_slope(square), u, v[1])
    return add(so3.dexp(u[1], v[0]), coupling), so3.dexp(u[1], v[1])


@always_inline
def dexpinv(u, v):
    """Return the inverse of `dexp(u, .)`; singular at a rotation of 2 pi (theory, eq. (5.19))."""
    coupling = _along(-0.5, cotangent_ratio(u[1]), cotangent_slope(u[1]), 0.0, u, v[1])
    return add(so3.dexpinv(u[1], v[0]), coupling), so3.dexpinv(u[1], v[1])


@always_inline
def retract(g, u):
    """Return g exp(u): g moved along the screw u in body coordinates."""
    return Pose(add(g[0], rotate(g[1], so3.dexp(u[1], u[0]))), quaternion.retract(g[1], u[1]))


@always_inline
def embed(g, twist):
    """Return the derivative of the seven numbers."""
    return rotate(g[1], twist[0]), quaternion.embed(g[1], twist[1])


@always_inline
def normalise(g):
    """Normalise the attitude."""
    return Pose(g[0], quaternion.normalise(g[1]))


@always_inline
def bracket(u, v):
    """Return the bracket with the sign for right tangents (theory, eq. (5.3)): -[u, v]."""
    return commutator(v, u)


@always_inline
def transport(u, v):
    """Transport a tangent from g exp(u) back to g: Ad of exp(u/2), as on SO(3) (theory, eq. (5.20))."""
    return adjoint(exp((scale(0.5, u[0]), scale(0.5, u[1]))), v)


MANIFOLDS[Pose] = Manifold(retract, embed, normalise, bracket, transport)
