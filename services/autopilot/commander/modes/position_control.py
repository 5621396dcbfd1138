"""By hand: the sticks ask for velocities along the vehicle's own heading."""

import math
from typing import TYPE_CHECKING

from dynamics.vector import ZERO, Vec3, norm
from services.autopilot.commander.modes.base import FlightMode, stick

if TYPE_CHECKING:
    from services.autopilot.commander.pilot import Pilot

NAME = "position_control"
SLOW = 0.05  # [m/s] at which the place is held


class Mode(FlightMode):
    """Sticks: forward, left, up, yaw rate, each from -1 to 1."""

    def __init__(self, pilot: "Pilot", *values: float):
        self._place: Vec3 | None = None

    def step(self, pilot: "Pilot", dt: float) -> None:
        """Fly as the sticks say; hold the place when they are in the middle."""
        forward, left, up, yaw = (stick(pilot, k) for k in range(4))
        if not pilot.armed:
            return
        if up > 0.0:
            pilot.lift_off()
        if not pilot.flying:
            return
        guide, limits = pilot.guide, pilot.limits
        s, c = math.sin(guide.yaw), math.cos(guide.yaw)
        vertical = up * (limits.up if up > 0.0 else limits.down)
        across = limits.horizontal
        velocity = (across * (c * forward - s * left), across * (s * forward + c * left), vertical)
        if velocity != ZERO:
            self._place = None
        elif self._place is None and norm(guide.velocity) < SLOW:
            self._place = guide.position
        guide.along(velocity if self._place is None else guide.towards(self._place, limits), limits, dt)
        guide.turn_at(yaw * limits.yaw_rate, limits, dt)
