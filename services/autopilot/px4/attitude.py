"""Attitude loop of the PX4 cascade: thrust vector and yaw to attitude, quaternion P control to body rates.

D. Brescianini, M. Hehn, R. D'Andrea, "Nonlinear Quadrocopter Attitude Control", ETH Zurich, 2013: the thrust direction
has priority over the yaw, whose part of the error is scaled by a weight.
"""

from typing import NamedTuple

from lapwing.dynamics.lie.quaternion import Quaternion, conjugate, from_matrix, multiply, normalise, rotate, rotate_back
from lapwing.dynamics.vector import Vec3, cross, dot, norm, scale
from lapwing.kernels import always_inline, math
from lapwing.services.autopilot.mixer import clamp

UP = (0.0, 0.0, 1.0)
OPPOSITE = 1e-5  # 1 + cosine below which the shortest rotation has no axis


class Parameters(NamedTuple):
    """Gains and limits of the attitude loop."""

    gain: Vec3  # [1/s] roll, pitch, yaw
    yaw_weight: float  # 0..1
    rate_limit: Vec3  # [rad/s] roll, pitch, yaw


@always_inline
def attitude_setpoint(thrust: Vec3, yaw: float) -> Quaternion:
    """Return the attitude with body z along the thrust and the heading yaw [rad]; thrust points upwards."""
    z = scale(1.0 / norm(thrust), thrust)
    s, c = math.sincos(yaw)
    across = cross((-s, c, 0.0), z)
    x = scale(1.0 / norm(across), across)
    y = cross(z, x)
    return from_matrix((x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2]))


@always_inline
def shortest_rotation(a: Vec3, b: Vec3) -> Quaternion:
    """Return the shortest rotation that takes the unit vector a to the unit vector b, not opposite to it."""
    v = cross(a, b)
    return normalise(Quaternion(1.0 + dot(a, b), v[0], v[1], v[2]))


@always_inline
def weighted_setpoint(attitude: Quaternion, setpoint: Quaternion, yaw_weight: float) -> Quaternion:
    """Return the setpoint whose rotation about the desired thrust axis is scaled by the yaw weight (section 4)."""
    now, desired = rotate(attitude, UP), rotate(setpoint, UP)
    if 1.0 + dot(now, desired) < OPPOSITE:
        return setpoint
    reduced = multiply(shortest_rotation(now, desired), attitude)
    about = multiply(conjugate(reduced), setpoint)  # (cos, 0, 0, sin) of half the yaw error
    sign = -1.0 if about[0] < 0.0 else 1.0
    half = yaw_weight * math.atan2(sign * about[3], sign * about[0])
    s, c = math.sincos(half)
    return multiply(reduced, Quaternion(c, 0.0, 0.0, s))


@always_inline
def rate_setpoint(p: Parameters, attitude: Quaternion, setpoint: Quaternion, yaw_rate: float) -> Vec3:
    """Return the setpoint of omega_body [rad/s].

    Args:
        p: parameters.
        attitude: estimate.
        setpoint: desired attitude.
        yaw_rate: feed-forward about world z [rad/s].
    """
    e = multiply(conjugate(attitude), weighted_setpoint(attitude, setpoint, p.yaw_weight))
    twice = -2.0 if e[0] < 0.0 else 2.0
    forward = rotate_back(attitude, (0.0, 0.0, yaw_rate))
    yaw_gain = p.gain[2] / max(p.yaw_weight, 1e-3)  # small errors of the yaw get the whole gain
    return (
        clamp(twice * p.gain[0] * e[1] + forward[0], -p.rate_limit[0], p.rate_limit[0]),
        clamp(twice * p.gain[1] * e[2] + forward[1], -p.rate_limit[1], p.rate_limit[1]),
        clamp(twice * yaw_gain * e[3] + forward[2], -p.rate_limit[2], p.rate_limit[2]),
    )
