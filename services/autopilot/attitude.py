"""Attitude error and its rate about the body axes, by Euler angles or on SO(3)."""

from lapwing.dynamics.lie.quaternion import Quaternion, conjugate, from_roll_pitch_yaw, log, multiply, rotate
from lapwing.dynamics.vector import Vec3, subtract
from lapwing.kernels import always_inline, math


@always_inline
def wrap(angle: float) -> float:
    """Return the equivalent angle in [-pi, pi] [rad]."""
    return angle - 2.0 * math.pi * round(angle / (2.0 * math.pi))


@always_inline
def angle_rates(roll: float, pitch: float, omega_body: Vec3) -> Vec3:
    """Return the rates of roll, pitch and yaw [rad/s] from body rates (theory, eq. (4.17)); singular at +-pi/2."""
    s, c = math.sincos(roll)
    turn = (s * omega_body[1] + c * omega_body[2]) / math.cos(pitch)
    return (omega_body[0] + math.sin(pitch) * turn, c * omega_body[1] - s * omega_body[2], turn)


@always_inline
def body_rates(roll: float, pitch: float, rates: Vec3) -> Vec3:
    """Return omega_body of the rates of roll, pitch and yaw, the inverse of `angle_rates`."""
    s, c = math.sincos(roll)
    turn = math.cos(pitch) * rates[2]
    return (rates[0] - math.sin(pitch) * rates[2], c * rates[1] + s * turn, c * turn - s * rates[1])


@always_inline
def error_by_angle(angles: Vec3, angles_reference: Vec3, rates_reference: Vec3, omega_body: Vec3) -> tuple[Vec3, Vec3]:
    """Return reference minus measured (roll, pitch, yaw) [rad] and its derivative [rad/s], as in the paper."""
    rates = angle_rates(angles[0], angles[1], omega_body)
    roll, pitch, yaw = subtract(angles_reference, angles)
    return (roll, pitch, wrap(yaw)), subtract(rates_reference, rates)


@always_inline
def error_on_so3(
    attitude: Quaternion, angles_reference: Vec3, rates_reference: Vec3, omega_body: Vec3
) -> tuple[Vec3, Vec3]:
    """Return the rotation vector [rad] in body axes from the attitude to the reference and its rate [rad/s].

    Free of singularities (theory, eq. (4.18)).
    """
    reference = from_roll_pitch_yaw(angles_reference[0], angles_reference[1], angles_reference[2])
    between = multiply(conjugate(attitude), reference)
    omega_reference = rotate(between, body_rates(angles_reference[0], angles_reference[1], rates_reference))
    return log(between), subtract(omega_reference, omega_body)
