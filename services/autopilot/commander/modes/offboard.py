"""Setpoints from outside: positions, velocities, accelerations, or an attitude with its thrust."""

import math
from typing import TYPE_CHECKING

from dynamics.lie.quaternion import Quaternion, to_roll_pitch_yaw
from dynamics.vector import ZERO, Vec3, add, scale, subtract
from services.autopilot.commander.guide import shortened
from services.autopilot.commander.modes.base import FlightMode, value
from services.autopilot.interface import Setpoint

if TYPE_CHECKING:
    from services.autopilot.commander.pilot import Pilot

NAME = "offboard"


class Mode(FlightMode):
    """Follows the newest setpoint; the pilot's failsafe watches that there is one."""

    def __init__(self, pilot: "Pilot", *values: float):
        if not pilot.offboard_fresh:
            raise ValueError("offboard: no setpoints are coming")

    def step(self, pilot: "Pilot", dt: float) -> None:
        """Towards the setpoint, within the limits."""
        kind, values = pilot.offboard
        if not pilot.armed:
            return
        if kind == "offboard_attitude":
            self._tilt(pilot, values)
            return
        place, velocity, acceleration = ([value(values, 3 * row + k) for k in range(3)] for row in range(3))
        guide, limits = pilot.guide, pilot.limits
        if place[2] > guide.position[2] or velocity[2] > 0.0 or acceleration[2] > 0.0:
            pilot.lift_off()
        if not pilot.flying:
            return
        target = tuple(h if math.isnan(p) else p for h, p in zip(guide.position, place, strict=True))
        way = guide.towards(target, limits)  # type: ignore[arg-type]
        pushed = scale(0.5, shortened(_or_zero(acceleration), limits.acceleration))  # held for half a second
        kept = tuple(
            v if math.isnan(p) and math.isnan(asked) and not math.isnan(a) else 0.0
            for v, p, asked, a in zip(guide.velocity, place, velocity, acceleration, strict=True)
        )
        guide.along(add(add(way, _or_zero(velocity)), add(pushed, kept)), limits, dt)  # type: ignore[arg-type]
        rate = value(values, 10)
        if math.isnan(rate):
            guide.turn_to(value(values, 9), limits, dt)
        else:
            guide.turn_at(rate, limits, dt)

    def _tilt(self, pilot: "Pilot", values: tuple[float, ...]) -> None:
        """An attitude as what the controller makes it of: tilts are accelerations, a thrust one upwards."""
        thrust = value(values, 7)
        if thrust > pilot.hover_share:
            pilot.lift_off()
        if not pilot.flying:
            return
        q = Quaternion(*(value(values, k) for k in range(4)))
        roll, pitch, yaw = (0.0, 0.0, pilot.guide.yaw) if math.isnan(q.w) else to_roll_pitch_yaw(q)
        s, c, g = math.sin(yaw), math.cos(yaw), pilot.gravity
        forward, left = g * pitch, -g * roll
        share = pilot.hover_share if math.isnan(thrust) else thrust
        up = g * (share / pilot.hover_share * math.cos(roll) * math.cos(pitch) - 1.0)
        rate = value(values, 6)
        acceleration = (c * forward - s * left, s * forward + c * left, up)
        e = pilot.estimate
        direct = Setpoint(e.position_world, e.velocity_world, acceleration, yaw, 0.0 if math.isnan(rate) else rate)
        pilot.follow(direct)


def _or_zero(v: list[float]) -> Vec3:
    x, y, z = (0.0 if math.isnan(c) else c for c in v)
    return subtract((x, y, z), ZERO)
