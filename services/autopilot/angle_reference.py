"""Smoothed angle reference of the inner loop with rate and acceleration (theory, eqs. (4.14)-(4.16))."""

from typing import NamedTuple

from lapwing.kernels import always_inline, math


class Smoothing(NamedTuple):
    """A second-order filter, followed by the motor lag if the torque is fed forward."""

    bandwidth: float  # natural frequency [rad/s]
    damping: float  # 1 = critical
    lag: float  # [s]; 0 without feed-forward


class Angle(NamedTuple):
    """State of the filter; the demand leads the reference by the lag."""

    command: float  # [rad]
    command_rate: float  # [rad/s]
    command_acceleration: float  # [rad/s^2]
    angle: float  # the reference [rad]
    rate: float  # [rad/s]
    acceleration: float  # [rad/s^2]


AT_REST = Angle(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@always_inline
def advance(p: Smoothing, s: Angle, target: float, dt: float) -> Angle:
    """Return the state after dt [s] with input `target` [rad]; dt times bandwidth must stay well below 1."""
    acceleration = p.bandwidth * (p.bandwidth * (target - s.command) - 2.0 * p.damping * s.command_rate)
    command = s.command + dt * (s.command_rate + 0.5 * dt * acceleration)
    command_rate = s.command_rate + dt * acceleration
    if p.lag == 0.0:
        return Angle(command, command_rate, acceleration, command, command_rate, acceleration)
    # Exact response of a first-order lag to a constant demand.
    excess = s.acceleration - acceleration
    decay = math.exp(-dt / p.lag)
    first = p.lag * (1.0 - decay)
    angle = s.angle + dt * (s.rate + 0.5 * dt * acceleration) + excess * p.lag * (dt - first)
    rate = s.rate + dt * acceleration + excess * first
    return Angle(command, command_rate, acceleration, angle, rate, acceleration + excess * decay)
