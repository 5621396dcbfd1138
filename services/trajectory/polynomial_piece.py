"""Polynomial pieces, the primitive of all segments, and their compiled evaluation (theory, eq. (4.1))."""

from typing import NamedTuple

import numpy as np

from lapwing.dynamics.vector import Vec3, add
from lapwing.kernels import always_inline, kernel, math
from lapwing.services.common.ports import Setpoint

WIDTH = 9  # columns of a coefficient row: six of the quintic, then amplitude, frequency, sweep


class Piece(NamedTuple):
    """A quintic plus a swept sine; u is the unit of the channel (m or rad)."""

    duration: float  # [s]
    polynomial: tuple[float, ...]  # c_i [u/s^i], at most six, lowest power first
    amplitude: float = 0.0  # [u]
    frequency: float = 0.0  # at the start of the piece [rad/s]
    sweep: float = 0.0  # half the rate of change of the frequency [rad/s^2]

    def row(self) -> tuple[float, ...]:
        """Return the coefficient row for the compiled evaluation."""
        padding = (0.0,) * (WIDTH - 3 - len(self.polynomial))
        return (*self.polynomial, *padding, self.amplitude, self.frequency, self.sweep)


class Channel(NamedTuple):
    """Consecutive pieces of one channel; the last has no end."""

    start: np.ndarray  # (n,) start times, ascending [s]
    coefficients: np.ndarray  # (n, 9)


class Parameters(NamedTuple):
    """A compiled trajectory: displacements of four channels from an origin."""

    x: Channel
    y: Channel
    z: Channel
    yaw: Channel
    phase_start: np.ndarray  # (phases,) [s]
    phase_release: np.ndarray  # (phases,) 1 if the payload is released
    phase_landing_speed: np.ndarray  # (phases,) see `Setpoint`
    origin_world: Vec3  # [m]
    origin_yaw: float  # [rad]


@always_inline
def last_not_after(times: np.ndarray, t: float) -> int:
    """Return the index of the last entry of ascending `times` that is <= t, or 0."""
    low, high = 0, len(times)
    while high - low > 1:
        middle = (low + high) // 2
        if times[middle] <= t:
            low = middle
        else:
            high = middle
    return low


@always_inline
def channel_at(channel: Channel, t: float) -> Vec3:
    """Return value, first and second derivative of a channel at time t [s] (theory, eq. (4.1))."""
    k = last_not_after(channel.start, t)
    c = channel.coefficients[k]
    s = t - channel.start[k]
    value = c[0] + s * (c[1] + s * (c[2] + s * (c[3] + s * (c[4] + s * c[5]))))
    rate = c[1] + s * (2.0 * c[2] + s * (3.0 * c[3] + s * (4.0 * c[4] + s * 5.0 * c[5])))
    acceleration = 2.0 * c[2] + s * (6.0 * c[3] + s * (12.0 * c[4] + s * 20.0 * c[5]))
    if c[6] != 0.0:
        angle = s * (c[7] + s * c[8])
        frequency = c[7] + 2.0 * s * c[8]
        sine, cosine = c[6] * math.sin(angle), c[6] * math.cos(angle)
        value += sine
        rate += frequency * cosine
        acceleration += 2.0 * c[8] * cosine - frequency * frequency * sine
    return value, rate, acceleration


@kernel
def evaluate(p: Parameters, t: float, final: int) -> Setpoint:
    """Return the setpoint at time t [s]; constant before 0 and after the end.

    Derivatives are right-sided at joints. `final` is the index of the first phase after which none ends in the air.
    """
    t = max(t, 0.0)
    x, vx, ax = channel_at(p.x, t)
    y, vy, ay = channel_at(p.y, t)
    z, vz, az = channel_at(p.z, t)
    yaw, yaw_rate, _ = channel_at(p.yaw, t)
    phase = last_not_after(p.phase_start, t)
    return Setpoint(
        add(p.origin_world, (x, y, z)),
        (vx, vy, vz),
        (ax, ay, az),
        p.origin_yaw + yaw,
        yaw_rate,
        phase,
        phase >= final,
        p.phase_release[phase] > 0.0,
        p.phase_landing_speed[phase],
    )
