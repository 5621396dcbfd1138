"""Position smoothing: a setpoint with limited jerk, acceleration and speed, independent of the estimate."""

from typing import NamedTuple

from lapwing.dynamics.vector import ZERO, Vec3, add, dot, norm, scale, subtract
from lapwing.kernels import math
from lapwing.services.common.ports import Setpoint

_POSITION_GAIN = 1.0  # [1/s] speed over distance in the last metre
_VELOCITY_GAIN = 3.0  # [1/s] acceleration over error of the velocity
_LOOK_AHEAD, _LOOK_AHEAD_TIME = 1.0, 1.0  # [m], [s] look-ahead along a line


class Limits(NamedTuple):
    """Limits of the setpoint."""

    horizontal: float  # [m/s]
    up: float  # [m/s]
    down: float  # [m/s]
    acceleration: float  # [m/s^2]
    jerk: float  # [m/s^3]
    yaw_rate: float  # [rad/s]


def clamp_norm(v: Vec3, maximum: float) -> Vec3:
    """Return the vector, shortened to the length `maximum` if it is longer."""
    length = norm(v)
    return scale(maximum / length, v) if length > maximum else v


def limit_velocity(velocity_world: Vec3, limits: Limits) -> Vec3:
    """Return the velocity [m/s] scaled to the speed limits."""
    x, y, z = velocity_world
    vertical = limits.up if z > 0.0 else limits.down
    excess = max(1.0, math.hypot(x, y) / limits.horizontal, abs(z) / vertical)
    return scale(1.0 / excess, velocity_world)


def braking_speed(distance: float, acceleration: float) -> float:
    """Return the speed [m/s] from which the setpoint stops in `distance` [m] at half of `acceleration` [m/s^2]."""
    brake = 0.5 * acceleration
    bend = brake / (_POSITION_GAIN * _POSITION_GAIN)
    return _POSITION_GAIN * distance if distance < bend else math.sqrt(2.0 * brake * (distance - 0.5 * bend))


def stopping_distance(speed: float, acceleration: float) -> float:
    """Return the distance [m] at which `braking_speed` is `speed` [m/s]."""
    brake = 0.5 * acceleration
    bend = brake / (_POSITION_GAIN * _POSITION_GAIN)
    within = speed < _POSITION_GAIN * bend
    return speed / _POSITION_GAIN if within else speed * speed / (2.0 * brake) + 0.5 * bend


def wrap_angle(angle: float) -> float:
    """Return the equivalent angle in [-pi, pi] [rad]."""
    return math.remainder(angle, 2.0 * math.pi)


class PositionSmoothing:
    """The smoothed setpoint."""

    def __init__(self, position_world: Vec3, yaw: float, velocity_world: Vec3 = ZERO):
        """Start at a position [m], yaw [rad] and velocity [m/s]."""
        self.position, self.velocity, self.acceleration = position_world, velocity_world, ZERO
        self.yaw, self.yaw_rate = yaw, 0.0

    @property
    def setpoint(self) -> Setpoint:
        """Setpoint for the controller."""
        return Setpoint(self.position, self.velocity, self.acceleration, self.yaw, self.yaw_rate)

    def move_to(self, target_world: Vec3, limits: Limits, dt: float) -> None:
        """Move towards a position [m], with a stop there, for a tick of dt [s]."""
        self.move_at(self.velocity_to(target_world, limits), limits, dt)

    def velocity_to(self, target_world: Vec3, limits: Limits) -> Vec3:
        """Return the velocity [m/s] towards a position [m] with a stop there."""
        way = subtract(target_world, self.position)
        distance = norm(way)
        if distance == 0.0:
            return ZERO
        return limit_velocity(scale(braking_speed(distance, limits.acceleration) / distance, way), limits)

    def velocity_along(self, start_world: Vec3, target_world: Vec3, passing_speed: float, limits: Limits) -> Vec3:
        """Return the velocity [m/s] along a line to a position [m] that is passed at a speed [m/s]."""
        way = subtract(target_world, self.position)
        distance, track = norm(way), subtract(target_world, start_world)
        if distance == 0.0:
            return ZERO
        aim, length = way, norm(track)
        if length > 0.0 and (along := dot(way, track) / length) > 0.0:
            ahead = min(along, max(_LOOK_AHEAD, norm(self.velocity) * _LOOK_AHEAD_TIME))
            aim = subtract(way, scale((along - ahead) / length, track))
        speed = braking_speed(distance + stopping_distance(passing_speed, limits.acceleration), limits.acceleration)
        return limit_velocity(scale(speed / norm(aim), aim), limits)

    def move_at(self, velocity_world: Vec3, limits: Limits, dt: float) -> None:
        """Move at a velocity [m/s] for a tick of dt [s]."""
        error = subtract(limit_velocity(velocity_world, limits), self.velocity)
        desired = clamp_norm(scale(_VELOCITY_GAIN * self._gain_fraction(error, limits), error), limits.acceleration)
        change = clamp_norm(subtract(desired, self.acceleration), limits.jerk * dt)
        acceleration = add(self.acceleration, change)
        step = scale(0.5 * dt, add(self.acceleration, acceleration))
        self.position = add(self.position, scale(dt, add(self.velocity, scale(0.5, step))))
        self.velocity, self.acceleration = add(self.velocity, step), acceleration

    @staticmethod
    def _gain_fraction(error: Vec3, limits: Limits) -> float:
        # The acceleration must reach zero together with the velocity error, which still changes by a^2 / 2j.
        size = norm(error)
        return min(1.0, math.sqrt(limits.jerk * size) / (_VELOCITY_GAIN * size)) if size > 0.0 else 1.0

    def turn_to(self, yaw: float, limits: Limits, dt: float) -> None:
        """Turn towards a yaw [rad] by the shorter way for a tick of dt [s]; NaN: keep the yaw."""
        left = 0.0 if math.isnan(yaw) else wrap_angle(yaw - self.yaw)
        rate = math.copysign(min(limits.yaw_rate, braking_speed(abs(left), limits.yaw_rate)), left)
        self.turn_at(rate, limits, dt)

    def turn_at(self, yaw_rate: float, limits: Limits, dt: float) -> None:
        """Turn at a rate [rad/s] for a tick of dt [s]."""
        rate = max(-limits.yaw_rate, min(limits.yaw_rate, yaw_rate))
        maximum_change = 2.0 * limits.yaw_rate * dt
        self.yaw_rate += max(-maximum_change, min(maximum_change, rate - self.yaw_rate))
        self.yaw += dt * self.yaw_rate
