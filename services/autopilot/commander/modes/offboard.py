"""Offboard control by position, velocity, acceleration, attitude, body rates and thrust, or motor voltages."""

import math

from lapwing.dynamics.lie.quaternion import Quaternion, from_roll_pitch_yaw, to_roll_pitch_yaw
from lapwing.dynamics.vector import ZERO, Vec3, add, scale
from lapwing.services.autopilot.commander.attitude_flight import AttitudeFlight
from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.commander.flight_mode import FlightMode, fill_in, value, vector
from lapwing.services.autopilot.commander.guidance import Guidance
from lapwing.services.autopilot.commander.smoothing import clamp_norm
from lapwing.services.autopilot.land_detector import TAKEOFF_HEIGHT
from lapwing.services.common.ports import Setpoint

NAME = "offboard"
ACCELERATION_TIME = 0.5  # [s] assumed duration of an acceleration
SINKING = 1.0  # [m/s] minimum descent setpoint with motors off, which enables landing detection


class Mode(FlightMode):
    """Follows the newest setpoint; a failsafe handles the loss of setpoints."""

    def __init__(self, constants: Constants, guidance: Guidance, *values: float):
        if not guidance.offboard_available:
            rejection = guidance.inputs.offboard_rejection
            raise ValueError(f"offboard: no setpoints received{rejection and f'; the last was rejected: {rejection}'}")
        self._attitude: AttitudeFlight | None = None

    def step(self, constants: Constants, view: CommanderInput, guidance: Guidance) -> Setpoint | None:
        """Move towards the setpoint within the limits."""
        values = guidance.inputs.offboard
        self.motor_voltage = None
        if not guidance.armed:
            return None
        if guidance.inputs.offboard_kind == "offboard_motors":
            return self._drive(constants, view, guidance, values)
        if guidance.inputs.offboard_kind == "offboard_attitude":
            return self._follow_attitude(constants, view, guidance, values)
        self._attitude = None
        position, velocity, acceleration = (vector(values, 3 * row) for row in range(3))
        if position[2] > guidance.smoothing.position[2] or velocity[2] > 0.0 or acceleration[2] > 0.0:
            guidance.lift_off(constants, view)
        if guidance.flying:
            _follow_position(view, guidance, position, velocity, acceleration)
            rate = value(values, 10)
            if math.isnan(rate):
                guidance.smoothing.turn_to(value(values, 9), guidance.limits, view.dt)
            else:
                guidance.smoothing.turn_at(rate, guidance.limits, view.dt)
        return None

    def _drive(
        self, constants: Constants, view: CommanderInput, guidance: Guidance, volts: tuple[float, ...]
    ) -> Setpoint | None:
        """Apply motor voltages [V]. The setpoint follows the vehicle, for later modes."""
        self._attitude = None
        turning = any(v > 0.0 for v in volts)
        if turning:
            guidance.lift_off(constants, view)
        if not guidance.flying:
            return None
        self.motor_voltage = volts
        (x, y, z), (vx, vy, vz) = view.estimate.position_world, view.estimate.velocity_world
        yaw = to_roll_pitch_yaw(view.estimate.attitude)[2]
        position = (x, y, max(z, constants.resting_height + TAKEOFF_HEIGHT))
        setpoint = Setpoint(position, (vx, vy, vz if turning else min(vz, -SINKING)), ZERO, yaw, 0.0)
        guidance.follow(setpoint)
        return setpoint

    def _follow_attitude(
        self, constants: Constants, view: CommanderInput, guidance: Guidance, values: tuple[float, ...]
    ) -> Setpoint | None:
        """Follow an attitude (w, x, y, z) or body rates [rad/s], with thrust over maximum or climb rate [m/s].

        NaN means missing. The yaw rate overrides the attitude's yaw.
        """
        thrust, climb_rate = value(values, 7), value(values, 8)
        if thrust > constants.hover_thrust or climb_rate > 0.0:
            guidance.lift_off(constants, view)
        if not guidance.flying:
            return None
        flight = self._attitude = self._attitude or AttitudeFlight(view)
        q, rates = Quaternion(*(value(values, k) for k in range(4))), _or_zero(vector(values, 4))
        if math.isnan(q.w):
            flight.turn(rates, guidance, view.dt)
        elif math.isnan(value(values, 6)):
            flight.set_attitude(q, guidance)
        else:
            roll, pitch, _ = to_roll_pitch_yaw(q)
            flight.set_attitude(from_roll_pitch_yaw(roll, pitch, flight.yaw + rates[2] * view.dt), guidance)
        return flight.setpoint(
            constants, view, guidance, rates[2], thrust, 0.0 if math.isnan(climb_rate) else climb_rate
        )


def _follow_position(
    view: CommanderInput, guidance: Guidance, position: Vec3, velocity: Vec3, acceleration: Vec3
) -> None:
    """Move the setpoint by position [m], velocity [m/s] and acceleration [m/s^2]; NaN means missing."""
    smoothing, limits = guidance.smoothing, guidance.limits
    approach = smoothing.velocity_to(fill_in(smoothing.position, position), limits)
    velocity_change = scale(ACCELERATION_TIME, clamp_norm(_or_zero(acceleration), limits.acceleration))
    x, y, z = (
        v if math.isnan(p) and math.isnan(requested) and not math.isnan(a) else 0.0
        for v, p, requested, a in zip(smoothing.velocity, position, velocity, acceleration, strict=True)
    )  # an acceleration alone adds to the present velocity
    smoothing.move_at(add(add(approach, _or_zero(velocity)), add(velocity_change, (x, y, z))), limits, view.dt)


def _or_zero(v: Vec3) -> Vec3:
    x, y, z = (0.0 if math.isnan(c) else c for c in v)
    return x, y, z
