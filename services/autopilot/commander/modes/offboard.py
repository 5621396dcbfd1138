"""Setpoints from outside: positions, velocities, accelerations, or an attitude with its thrust."""

import math

from dynamics.lie.quaternion import Quaternion, to_roll_pitch_yaw
from dynamics.vector import Vec3, add, scale
from services.autopilot.commander.flight_mode import FlightMode, fill_in, value, vector
from services.autopilot.commander.guidance import Guidance
from services.autopilot.commander.smoothing import clamp_norm
from services.autopilot.commander.view import Constants, View
from services.autopilot.interface import Setpoint

NAME = "offboard"
ACCELERATION_TIME = 0.5  # [s] for which an acceleration is taken to last


class Mode(FlightMode):
    """Follows the newest setpoint; a failsafe watches that there is one."""

    def __init__(self, constants: Constants, guidance: Guidance, *values: float):
        if not guidance.offboard_fresh:
            raise ValueError("offboard: no setpoints are coming")

    def step(self, constants: Constants, view: View, guidance: Guidance) -> Setpoint | None:
        """Towards the setpoint, within the limits."""
        values = guidance.inputs.offboard
        if not guidance.armed:
            return None
        if guidance.inputs.offboard_kind == "offboard_attitude":
            return _follow_attitude(constants, view, guidance, values)
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


def _follow_position(view: View, guidance: Guidance, position: Vec3, velocity: Vec3, acceleration: Vec3) -> None:
    """Move the setpoint by what is given of position [m], velocity [m/s] and acceleration [m/s^2]; NaN: not given."""
    smoothing, limits = guidance.smoothing, guidance.limits
    approach = smoothing.velocity_to(fill_in(smoothing.position, position), limits)
    gained = scale(ACCELERATION_TIME, clamp_norm(_or_zero(acceleration), limits.acceleration))
    x, y, z = (
        v if math.isnan(p) and math.isnan(asked) and not math.isnan(a) else 0.0
        for v, p, asked, a in zip(smoothing.velocity, position, velocity, acceleration, strict=True)
    )  # where an acceleration alone is given, it adds to the present velocity
    smoothing.move_at(add(add(approach, _or_zero(velocity)), add(gained, (x, y, z))), limits, view.dt)


def _follow_attitude(
    constants: Constants, view: View, guidance: Guidance, values: tuple[float, ...]
) -> Setpoint | None:
    """An attitude as what the controller makes it of: tilts are accelerations, a thrust one upwards."""
    thrust = value(values, 7)
    if thrust > constants.hover_thrust:
        guidance.lift_off(constants, view)
    if not guidance.flying:
        return None
    q = Quaternion(*(value(values, k) for k in range(4)))
    roll, pitch, yaw = (0.0, 0.0, guidance.smoothing.yaw) if math.isnan(q.w) else to_roll_pitch_yaw(q)
    s, c, g = math.sin(yaw), math.cos(yaw), constants.gravity
    forward, left = g * pitch, -g * roll
    share = constants.hover_thrust if math.isnan(thrust) else thrust
    up = g * (share / constants.hover_thrust * math.cos(roll) * math.cos(pitch) - 1.0)
    rate = value(values, 6)
    acceleration = (c * forward - s * left, s * forward + c * left, up)
    e = view.estimate
    setpoint = Setpoint(e.position_world, e.velocity_world, acceleration, yaw, 0.0 if math.isnan(rate) else rate)
    guidance.follow(setpoint)
    return setpoint


def _or_zero(v: Vec3) -> Vec3:
    x, y, z = (0.0 if math.isnan(c) else c for c in v)
    return x, y, z
