"""Free rigid body: Euler's equations about principal axes (theory, eq. (7.1))."""

from typing import NamedTuple

from lapwing.dynamics.integrators import RATES
from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.vector import Vec3, cross, divide, multiply
from lapwing.kernels import always_inline


class RigidBody(NamedTuple):
    """State of a rotating body."""

    attitude: Quaternion
    omega_body: Vec3  # [rad/s]


class FreeBodyParameters(NamedTuple):
    """Parameters of a torque-free body."""

    inertia: Vec3  # [kg m^2] principal moments

    @property
    def torque_without_rate(self) -> bool:
        """True: the torque is zero."""
        return True


@always_inline
def rate(p, t, x):
    """Return the tangent: omega' = I^-1 (I omega x omega)."""
    o = x.omega_body
    return RigidBody(o, divide(cross(multiply(p.inertia, o), o), p.inertia))


RATES[FreeBodyParameters] = rate
