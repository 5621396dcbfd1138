"""Pilot of Betaflight: follows a trajectory with the sticks in ANGLE mode, like a companion computer with GPS."""

import math
from typing import NamedTuple

from lapwing.dynamics.vector import ZERO, Vec3
from lapwing.services.betaflight.packets import RC_HIGH, RC_LOW, RC_MIDDLE
from lapwing.services.betaflight.resolve import PilotConfig
from lapwing.services.common.ports import Setpoint

ARM_AT = 0.5  # [s] at which the arm switch is closed, with the throttle low
TAKEOFF_HEIGHT = 0.02  # [m] of the reference above the start, from which the pilot flies
LANDING_HEIGHT = 0.5  # [m] above the start, below which the landing begins
DESCENT = 0.4  # [m/s] below the end of the trajectory, until the vehicle rests
REST_TIME = 0.6  # [s] without vertical motion, after which the vehicle has landed
CONTACT_HEIGHT = 0.1  # [m] above the start
CONTACT_TIME = 0.3  # [s] below CONTACT_HEIGHT, after which a vehicle that bounces has landed
REST_SPEED = 0.12  # [m/s]
DISARM_TIME = 0.5  # [s] of low throttle before the run ends
ERROR_LIMIT = 2.0  # [m] of the position error on each axis
CLIMB_LIMIT = 6.0  # [m/s^2]
IDLE = 0.055  # output of an armed motor at low throttle
LOWEST = 1050  # [us] throttle channel from which on the output rises (min_check)
LOST_AFTER = 1.5  # [s] without a new position, after which the pilot descends level
LOST_DESCENT = 0.8  # [m/s] of that descent
LOST_REST, LOST_REST_TIME = 0.3, 1.5  # [m/s], [s] of slow vertical motion, after which the vehicle has landed
LOST_LONGEST = 120.0  # [s] of that descent, after which the motors stop in any case


class Motion(NamedTuple):
    """Measured motion of the vehicle."""

    position_world: Vec3  # [m]
    velocity_world: Vec3  # [m/s]
    yaw: float  # [rad] ENU, counter-clockwise from east
    age: float = 0.0  # [s] of the last measured position
    climb_rate: float = 0.0  # [m/s] by accelerometer and barometer, without the receiver


class Sticks(NamedTuple):
    """RC channels in the firmware's default order, AETR, and the switches for ARM and ANGLE."""

    roll: int
    pitch: int
    throttle: int
    yaw: int
    arm: int
    angle: int = RC_HIGH


OFF = Sticks(RC_MIDDLE, RC_MIDDLE, RC_LOW, RC_MIDDLE, RC_LOW)


class Pilot:
    """State of the pilot.

    Attributes:
        attitude_reference: roll, pitch, yaw that the sticks command [rad].
        stage: "waiting", "flying", "landing", "descending" without a position, or "landed".
        lost: True after the vehicle has lost its position in flight.
        finished: True once the vehicle is disarmed after the landing.
    """

    def __init__(self, config: PilotConfig, start_world: Vec3):
        """Create a pilot for a vehicle that rests at `start_world`."""
        self._config, self._start = config, start_world
        self._integral = [0.0, 0.0, 0.0]  # [m/s^2]
        self._still = self._near = self._landed = 0.0  # [s]
        self._descent = 0.0  # [m] of the setpoint below the trajectory's end
        self.attitude_reference: Vec3 = ZERO
        self.stage, self.finished, self.lost = "waiting", False, False

    def step(self, time: float, interval: float, setpoint: Setpoint, motion: Motion) -> Sticks:
        """Return the sticks at `time` [s], `interval` [s] after the last step."""
        fresh, height = motion.age < LOST_AFTER, motion.position_world[2] - self._start[2]
        desired_height = setpoint.position_world[2] - self._start[2]
        if self.stage == "waiting":
            if not fresh:
                return OFF
            if time > ARM_AT and desired_height > TAKEOFF_HEIGHT:
                self.stage = "flying"
            return OFF._replace(arm=RC_HIGH if time > ARM_AT else RC_LOW)
        if self.stage in ("flying", "landing") and not fresh:
            self.stage, self.lost, self._still = "descending", True, -LOST_REST_TIME  # time to begin the descent
        if self.stage == "descending":
            slow = self._still < 0.0 or abs(motion.climb_rate) < LOST_REST
            self._still, self._near = self._still + interval if slow else 0.0, self._near + interval
            if self._still > LOST_REST_TIME or self._near > LOST_LONGEST:
                self.stage = "landed"
        ends = desired_height < TAKEOFF_HEIGHT and abs(setpoint.velocity_world[2]) < 0.05  # at rest on the ground
        if self.stage == "flying" and setpoint.final and height < LANDING_HEIGHT and ends:
            self.stage = "landing"
        if self.stage == "landing":
            self._descent += DESCENT * interval
            slow = self._descent > 0.2 and abs(motion.velocity_world[2]) < REST_SPEED
            self._still = self._still + interval if slow else 0.0
            self._near += interval * (height < CONTACT_HEIGHT)
            if self._still > REST_TIME or self._near > CONTACT_TIME:
                self.stage = "landed"
        if self.stage == "landed":
            self._landed += interval
            self.finished = self._landed > DISARM_TIME
            return OFF._replace(arm=RC_HIGH if self._landed < 0.5 * DISARM_TIME else RC_LOW)
        return self._descend(motion) if self.stage == "descending" else self._fly(interval, setpoint, motion)

    def _descend(self, motion: Motion) -> Sticks:
        """Return the sticks of a level descent, for which the vehicle needs no position."""
        self.attitude_reference = (0.0, 0.0, motion.yaw)
        thrust = self._up(self._config.velocity_gain * (-LOST_DESCENT - motion.climb_rate))
        return OFF._replace(throttle=self._throttle(thrust), arm=RC_HIGH)

    def _up(self, acceleration: float) -> float:
        """Return the vertical specific force [m/s^2] for a vertical acceleration, which is limited."""
        gravity = self._config.gravity
        return _limited(acceleration, -0.6 * gravity, CLIMB_LIMIT) + gravity

    def _throttle(self, force: float) -> int:
        """Return the channel [us] for a specific force [m/s^2] along the thrust."""
        output = min(self._config.hover_output * math.sqrt(force / self._config.gravity), 1.0)
        return round(LOWEST + (RC_HIGH - LOWEST) * max(0.0, (output - IDLE) / (1.0 - IDLE)))

    def _fly(self, interval: float, setpoint: Setpoint, motion: Motion) -> Sticks:
        s, (x, y, z) = self._config, setpoint.position_world
        target = (x, y, z - min(self._descent, ERROR_LIMIT))
        error = [_limited(a - b, -ERROR_LIMIT, ERROR_LIMIT) for a, b in zip(target, motion.position_world, strict=True)]
        velocity_error = [a - b for a, b in zip(setpoint.velocity_world, motion.velocity_world, strict=True)]
        if self.stage == "landing":
            velocity_error[2] -= DESCENT
        else:
            change = [s.integral_gain * e * interval for e in error]
            self._integral = [_limited(i + d, -3.0, 3.0) for i, d in zip(self._integral, change, strict=True)]
        ax, ay, az = (
            feed + s.position_gain * e + s.velocity_gain * v + i
            for feed, e, v, i in zip(setpoint.acceleration_world, error, velocity_error, self._integral, strict=True)
        )
        az = self._up(az)
        c, sine = math.cos(motion.yaw), math.sin(motion.yaw)
        forward, left = c * ax + sine * ay, c * ay - sine * ax
        pitch, roll = math.atan2(forward, az), math.atan2(-left, math.hypot(forward, az))  # nose down, to the right
        limit = math.radians(s.tilt_limit_deg)
        self.attitude_reference = (_limited(roll, -limit, limit), _limited(pitch, -limit, limit), setpoint.yaw)
        yaw_error = (setpoint.yaw - motion.yaw + math.pi) % (2.0 * math.pi) - math.pi
        rate = setpoint.yaw_rate + s.yaw_gain * yaw_error
        return Sticks(
            _stick(roll / limit),
            _stick(pitch / limit),
            self._throttle(math.sqrt(forward * forward + left * left + az * az)),
            _stick(-rate / math.radians(s.yaw_rate_limit_deg)),
            RC_HIGH,
        )


def _limited(value: float, least: float, most: float) -> float:
    return max(least, min(most, value))


def _stick(deflection: float) -> int:
    """Return the channel [us] of a deflection from -1 to 1."""
    return round(RC_MIDDLE + (RC_HIGH - RC_MIDDLE) * _limited(deflection, -1.0, 1.0))
