"""Gyrostat satellite: a rigid platform with three rotors along its principal axes, the third spinning unevenly.

Lagrange-d'Alembert on SO(3) gives theory, eq. (7.7); after Ge and Lin, J. Sound Vib. 251 (2002) 519, whose numbers
use minutes in place of seconds. Zero parameters give the simpler cases: rotors at rest, no damping, no feedback.
"""

from typing import NamedTuple

from lapwing.dynamics.integrators import RATES
from lapwing.dynamics.lie.quaternion import Quaternion, conjugate, log, multiply
from lapwing.dynamics.vector import Vec3, add, cross, scale
from lapwing.dynamics.vector import multiply as multiply_each
from lapwing.dynamics.vehicles.rigid_body import RigidBody
from lapwing.kernels import always_inline, math


class GyrostatParameters(NamedTuple):
    """Blocked rotors have zero rotor_momentum, spinning ones zero damping, rotors with friction zero gains."""

    inertia: Vec3  # [kg m^2] platform with rotors
    rotor_momentum: Vec3  # [kg m^2/s] of the rotors, for the third its mean
    forcing_amplitude: float  # relative amplitude of the third rotor's speed
    forcing_frequency: float  # [rad/s]
    damping: float  # [N m s] about z
    linear_gain: Vec3  # [N m s]
    cubic_gain: Vec3  # [N m s^3]
    desired_rate: float  # [rad/s] about each axis
    attitude_gain: float  # [N m] gain of the control towards `target`; 0: no control
    rate_gain: float  # [N m s] of that control
    target: Quaternion  # attitude to reach

    @property
    def torque_without_rate(self) -> bool:
        """True if the torque of rotors, friction and feedback depends on time and attitude only."""
        of_rate = (*self.rotor_momentum, self.damping, *self.linear_gain, *self.cubic_gain, self.rate_gain)
        return not any(of_rate)


@always_inline
def rotor_momentum(p, t):
    """Return the momentum of the rotors and its derivative, both in the body (theory, eq. (7.6))."""
    h, w = p.rotor_momentum, p.forcing_frequency
    sine, cosine = math.sincos(w * t)
    momentum = (h[0], h[1], h[2] * (1.0 + p.forcing_amplitude * cosine))
    return momentum, (0.0, 0.0, -h[2] * p.forcing_amplitude * w * sine)


@always_inline
def attitude_torque(p, x):
    """Return the proportional-derivative control on SO(3) towards the target (theory, eq. (7.9))."""
    error = log(multiply(conjugate(p.target), x.attitude))
    return add(scale(-p.attitude_gain, error), scale(-p.rate_gain, x.omega_body))


@always_inline
def rate(p, t, x):
    """Return the tangent: I omega' = (I omega + h) x omega - h' - damping + feedback + control (eq. (7.7))."""
    o = x.omega_body
    h, h_rate = rotor_momentum(p, t)
    missing = (p.desired_rate - o[0], p.desired_rate - o[1], p.desired_rate - o[2])
    feedback = multiply_each(missing, add(p.linear_gain, multiply_each(p.cubic_gain, multiply_each(missing, missing))))
    torque = add(cross(add(multiply_each(p.inertia, o), h), o), scale(-1.0, h_rate))
    torque = add(torque, (0.0, 0.0, -p.damping * o[2]))
    if p.attitude_gain != 0.0:
        # the controller compensates the torque of the rotors
        torque = add(torque, add(attitude_torque(p, x), add(cross(o, h), h_rate)))
    inverse = (1.0 / p.inertia[0], 1.0 / p.inertia[1], 1.0 / p.inertia[2])
    return RigidBody(o, multiply_each(inverse, add(torque, feedback)))


RATES[GyrostatParameters] = rate
