"""Rigid motions: position and attitude, with the twist (v_body, omega_body) as tangent.

A pair (translation, rotation) of vectors is an element of se(3); its exponential is a screw motion.
"""

from typing import NamedTuple

from lapwing.dynamics.lie import quaternion, so3
from lapwing.dynamics.lie.quaternion import Quaternion, rotate
from lapwing.dynamics.vector import Vec3, add, cross, scale
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
def adjoint(g, u):
    """Return Ad_g u, with g exp(u) = exp(Ad_g u) g (theory, eq. (5.17))."""
    rotation = rotate(g[1], u[1])
    return add(rotate(g[1], u[0]), cross(g[0], rotation)), rotation


@always_inline
def commutator(u, v):
    """Return [u, v] in se(3): ad_u v."""
    return add(cross(u[1], v[0]), cross(u[0], v[1])), cross(u[1], v[1])


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
