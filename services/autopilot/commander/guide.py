"""A setpoint that moves like a vehicle: its jerk, acceleration and speed are limited.

The guide is a point that is led to a place or at a velocity. It knows nothing of the real vehicle, so the setpoint is
as smooth as its limits, and the same whatever the sensors say.
"""

import math
from typing import NamedTuple

from dynamics.vector import ZERO, Vec3, add, norm, scale, subtract
from services.autopilot.interface import Setpoint

_NEAR = 1.0  # [1/s] speed over distance in the last metre
_GRIP = 3.0  # [1/s] acceleration over error of the velocity


class Limits(NamedTuple):
    """How the setpoint may move."""

    horizontal: float  # [m/s]
    up: float  # [m/s]
    down: float  # [m/s]
    acceleration: float  # [m/s^2]
    jerk: float  # [m/s^3]
    yaw_rate: float  # [rad/s]


def shortened(v: Vec3, most: float) -> Vec3:
    """The vector, or one of the length `most` in its direction."""
    length = norm(v)
    return scale(most / length, v) if length > most else v


def limited(velocity_world: Vec3, limits: Limits) -> Vec3:
    """A velocity [m/s] in the same direction within the limits of speed."""
    x, y, z = velocity_world
    vertical = limits.up if z > 0.0 else limits.down
    excess = max(1.0, math.hypot(x, y) / limits.horizontal, abs(z) / vertical)
    return scale(1.0 / excess, velocity_world)


def approach(distance: float, acceleration: float) -> float:
    """Speed [m/s] at a distance [m] from which the guide can stop there at half of its acceleration [m/s^2]."""
    brake = 0.5 * acceleration
    bend = brake / (_NEAR * _NEAR)
    return _NEAR * distance if distance < bend else math.sqrt(2.0 * brake * (distance - 0.5 * bend))


def turn(angle: float) -> float:
    """The same angle in [-pi, pi] [rad]."""
    return math.remainder(angle, 2.0 * math.pi)


class Guide:
    """The point that the controller follows."""

    def __init__(self, position_world: Vec3, yaw: float, velocity_world: Vec3 = ZERO):
        """At a place, with a velocity."""
        self.position, self.velocity, self.acceleration = position_world, velocity_world, ZERO
        self.yaw, self.yaw_rate = yaw, 0.0

    @property
    def setpoint(self) -> Setpoint:
        """What the controller is asked for."""
        return Setpoint(self.position, self.velocity, self.acceleration, self.yaw, self.yaw_rate)

    def to(self, target_world: Vec3, limits: Limits, dt: float) -> None:
        """Lead the point straight to a place and stop there."""
        self.along(self.towards(target_world, limits), limits, dt)

    def towards(self, target_world: Vec3, limits: Limits) -> Vec3:
        """The velocity [m/s] of the way to a place."""
        way = subtract(target_world, self.position)
        distance = norm(way)
        if distance == 0.0:
            return ZERO
        return limited(scale(approach(distance, limits.acceleration) / distance, way), limits)

    def along(self, velocity_world: Vec3, limits: Limits, dt: float) -> None:
        """Lead the point at a velocity [m/s]."""
        error = subtract(limited(velocity_world, limits), self.velocity)
        wanted = shortened(scale(_GRIP * self._ease(error, limits), error), limits.acceleration)
        change = shortened(subtract(wanted, self.acceleration), limits.jerk * dt)
        acceleration = add(self.acceleration, change)
        step = scale(0.5 * dt, add(self.acceleration, acceleration))
        self.position = add(self.position, scale(dt, add(self.velocity, scale(0.5, step))))
        self.velocity, self.acceleration = add(self.velocity, step), acceleration

    @staticmethod
    def _ease(error: Vec3, limits: Limits) -> float:
        # The acceleration must fade to zero, within its jerk, when the velocity is reached: a^2 / 2j is still to come.
        size = norm(error)
        return min(1.0, math.sqrt(limits.jerk * size) / (_GRIP * size)) if size > 0.0 else 1.0

    def turn_to(self, yaw: float, limits: Limits, dt: float) -> None:
        """Turn towards a yaw [rad] by the shorter way; NaN: stay."""
        left = 0.0 if math.isnan(yaw) else turn(yaw - self.yaw)
        rate = math.copysign(min(limits.yaw_rate, approach(abs(left), limits.yaw_rate)), left)
        self.turn_at(rate, limits, dt)

    def turn_at(self, yaw_rate: float, limits: Limits, dt: float) -> None:
        """Turn at a rate [rad/s]."""
        rate = max(-limits.yaw_rate, min(limits.yaw_rate, yaw_rate))
        most = 2.0 * limits.yaw_rate * dt
        self.yaw_rate += max(-most, min(most, rate - self.yaw_rate))
        self.yaw += dt * self.yaw_rate
