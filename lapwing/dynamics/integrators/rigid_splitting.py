"""Splitting for rigid bodies into turns about the three principal axes, each an exact flow; order 6, no energy drift.

The free body's kinetic energy is a sum of three terms whose flows are plain rotations (McLachlan 1993; Reich 1994); the
torque, of time and attitude only, is a kick between them. Strang's symmetric composition of these is raised to order 6
by the nine stages of Kahan and Li, Math. Comp. 66 (1997) 1089. The momentum of a free body is only ever rotated, so it
is kept to round-off in the world, and the energy error stays bounded for all times (theory, section 6.6).
"""

from typing import Any

from lapwing.dynamics.integrators._fixed_step import method_token
from lapwing.dynamics.lie.quaternion import Quaternion, normalise
from lapwing.dynamics.vector import add, cross, divide, multiply, scale
from lapwing.kernels import always_inline, math
from lapwing.kernels.state_tree import flatten, unflatten

ORDER = 6
EVALUATIONS = 10
ON_MANIFOLD = True
Method = method_token(__name__)

_HALF = (0.39216144400731413928, 0.33259913678935943860, -0.70624617255763935981, 0.08221359629355080023)
STAGES = (*_HALF, 1.0 - 2.0 * math.total(_HALF), *_HALF[::-1])


def incompatibility(p: Any, x: Any) -> str:
    """Return the reason why the method does not support parameters p and states like x; "" if it does.

    The state must be (attitude, omega_body). The parameters need `inertia`, the principal moments [kg m^2], and
    `torque_without_rate`, True if the torque depends on time and attitude only; otherwise the kicks have order 1.
    """
    if getattr(x, "_fields", ()) != ("attitude", "omega_body"):
        return "it is for states of attitude and omega_body"
    return "" if getattr(p, "torque_without_rate", False) else "it is for a torque that does not depend on the rate"


@always_inline
def _spin(w, a, b, c, momentum_b, momentum_c, angle):
    """Turn by `angle` about the body axis a: quaternion (w, a, b, c with a, b, c cyclic) and the other momenta."""
    sine, cosine = math.sincos(0.5 * angle)
    cc, ss = 1.0 - 2.0 * sine * sine, 2.0 * sine * cosine
    return (
        cosine * w - sine * a,
        cosine * a + sine * w,
        cosine * b + sine * c,
        cosine * c - sine * b,
        cc * momentum_b + ss * momentum_c,
        cc * momentum_c - ss * momentum_b,
    )


@always_inline
def free_flow(inertia, attitude, momentum_body, h):
    """Return the Strang composition of three exact flows: x, y for half the time, z for all of it (eq. (6.15))."""
    w, x, y, z = attitude
    lx, ly, lz = momentum_body
    half = 0.5 * h
    w, x, y, z, ly, lz = _spin(w, x, y, z, ly, lz, half * lx / inertia[0])
    w, y, z, x, lz, lx = _spin(w, y, z, x, lz, lx, half * ly / inertia[1])
    w, z, x, y, lx, ly = _spin(w, z, x, y, lx, ly, h * lz / inertia[2])
    w, y, z, x, lz, lx = _spin(w, y, z, x, lz, lx, half * ly / inertia[1])
    w, x, y, z, ly, lz = _spin(w, x, y, z, ly, lz, half * lx / inertia[0])
    return normalise(Quaternion(w, x, y, z)), (lx, ly, lz)


@always_inline
def _torque(rate, p, t, x):
    """Return the torque beyond the free body: I omega' + omega x I omega."""
    return add(multiply(p.inertia, rate(p, t, x)[1]), cross(x[1], multiply(p.inertia, x[1])))


@always_inline
def step(rate, p, t, x, h):
    """Take nine Strang steps of kick, free flow, kick, with adjacent kicks combined (theory, eq. (6.16))."""
    attitude, momentum = x[0], multiply(p.inertia, x[1])
    before = 0.0
    for stage in STAGES:
        momentum = add(momentum, scale(0.5 * h * (before + stage), _torque(rate, p, t, x)))
        attitude, momentum = free_flow(p.inertia, attitude, momentum, stage * h)
        t += stage * h
        x = unflatten(x, flatten((attitude, divide(momentum, p.inertia))))
        before = stage
    momentum = add(momentum, scale(0.5 * h * before, _torque(rate, p, t, x)))
    return unflatten(x, flatten((attitude, divide(momentum, p.inertia))))
