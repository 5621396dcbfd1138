"""Pilot of Betaflight: follows a trajectory with the sticks in ANGLE mode, like a companion computer with GPS."""

import math
from typing import NamedTuple

from lapwing.dynamics.vector import ZERO, Vec3
from lapwing.services.betaflight.packets import RC_HIGH, RC_LOW, RC_MIDDLE
from lapwing.services.betaflight.resolve import PilotSetup
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


class Motion(NamedTuple):
    """Measured motion of the vehicle."""

    position_world: Vec3  # [m]
    velocity_world: Vec3  # [m/s]
    yaw: float  # [rad] ENU, counter-clockwise from east


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
        stage: "waiting", "flying", "landing" or "landed".
        finished: True once the vehicle is disarmed after the landing.
    """

    def __init__(self, setup: PilotSetup, start_world: Vec3):
        """Create a pilot for a vehicle that rests at `start_world`."""
        self._setup, self._start = setup, start_world
        self._integral: Vec3 = ZERO
        self._still = self._near = self._landed = 0.0  # [s]
        self._descent = 0.0  # [m] of the setpoint below the trajectory's end
        self.attitude_reference: Vec3 = ZERO
        self.stage, self.finished = "waiting", False

    def step(self, time: float, interval: float, setpoint: Setpoint, motion: Motion) -> Sticks:
        """Return the sticks at `time` [s], `interval` [s] after the last step."""
        if self.stage == "waiting":
            if time > ARM_AT and setpoint.position_world[2] > self._start[2] + TAKEOFF_HEIGHT:
                self.stage = "flying"
            return OFF._replace(arm=RC_HIGH if time > ARM_AT else RC_LOW)
        low = motion.position_world[2] < self._start[2] + LANDING_HEIGHT
        if self.stage == "flying" and setpoint.final and low and self._ends(setpoint):
            self.stage = "landing"
        if self.stage == "landing":
            self._descent += DESCENT * interval
            velocity = motion.velocity_world[2]
            self._still = self._still + interval if self._descent > 0.2 and abs(velocity) < REST_SPEED else 0.0
            if motion.position_world[2] < self._start[2] + CONTACT_HEIGHT:
                self._near += interval
            if self._still > REST_TIME or self._near > CONTACT_TIME:
                self.stage = "landed"
        if self.stage == "landed":
            self._landed += interval
            self.finished = self._landed > DISARM_TIME
            return OFF._replace(arm=RC_HIGH if self._landed < 0.5 * DISARM_TIME else RC_LOW)
        return self._fly(interval, setpoint, motion)

    def _ends(self, setpoint: Setpoint) -> bool:
        """Return True if the reference is at rest on the ground."""
        return setpoint.position_world[2] < self._start[2] + TAKEOFF_HEIGHT and abs(setpoint.velocity_world[2]) < 0.05

    def _fly(self, interval: float, setpoint: Setpoint, motion: Motion) -> Sticks:
        s = self._setup
        offset = (0.0, 0.0, min(self._descent, ERROR_LIMIT))
        target = tuple(w - d for w, d in zip(setpoint.position_world, offset, strict=True))
        error = [max(-ERROR_LIMIT, min(ERROR_LIMIT, a - b)) for a, b in zip(target, motion.position_world, strict=True)]
        velocity_error = [a - b for a, b in zip(setpoint.velocity_world, motion.velocity_world, strict=True)]
        if self.stage == "landing":
            velocity_error[2] -= DESCENT
        else:
            self._integral = tuple(  # type: ignore[assignment]
                max(-3.0, min(3.0, i + s.integral_gain * e * interval))
                for i, e in zip(self._integral, error, strict=True)
            )
        ax, ay, az = (
            feed + s.position_gain * e + s.velocity_gain * v + i
            for feed, e, v, i in zip(setpoint.acceleration_world, error, velocity_error, self._integral, strict=True)
        )
        az = max(-0.6 * s.gravity, min(CLIMB_LIMIT, az)) + s.gravity
        c, sine = math.cos(motion.yaw), math.sin(motion.yaw)
        forward, left = c * ax + sine * ay, c * ay - sine * ax
        pitch, roll = math.atan2(forward, az), math.atan2(-left, math.hypot(forward, az))  # nose down, to the right
        limit = math.radians(s.tilt_limit_deg)
        self.attitude_reference = (max(-limit, min(limit, roll)), max(-limit, min(limit, pitch)), setpoint.yaw)
        thrust = math.sqrt(forward * forward + left * left + az * az) / s.gravity
        output = min(s.hover_output * math.sqrt(thrust), 1.0)
        yaw_error = (setpoint.yaw - motion.yaw + math.pi) % (2.0 * math.pi) - math.pi
        rate = setpoint.yaw_rate + s.yaw_gain * yaw_error
        return Sticks(
            _stick(roll / limit),
            _stick(pitch / limit),
            round(LOWEST + (RC_HIGH - LOWEST) * max(0.0, (output - IDLE) / (1.0 - IDLE))),
            _stick(-rate / math.radians(s.yaw_rate_limit_deg)),
            RC_HIGH,
        )


def _stick(deflection: float) -> int:
    """Return the channel [us] of a deflection from -1 to 1."""
    return round(RC_MIDDLE + (RC_HIGH - RC_MIDDLE) * max(-1.0, min(1.0, deflection)))
