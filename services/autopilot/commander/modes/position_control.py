"""By hand: the sticks ask for velocities along the vehicle's own heading."""

import math
from typing import TYPE_CHECKING

from dynamics.vector import ZERO, Vec3, norm
from services.autopilot.commander.modes.base import FlightMode, value

if TYPE_CHECKING:
    from services.autopilot.commander.pilot import Pilot

NAME = "position_control"
DEAD = 0.05  # sticks nearer to the middle ask for nothing
STICK_TIMEOUT = 1.0  # [s] older sticks are in the middle


class Mode(FlightMode):
    """Sticks: forward, left, up, yaw rate, each from -1 to 1."""

    def __init__(self, pilot: "Pilot", *values: float):
        self._sticks = (0.0, 0.0, 0.0, 0.0)
        self._age = math.inf
        self._place: Vec3 | None = None

    def take(self, values: tuple[float, ...]) -> None:
        """The sticks as they are now."""
        given = [max(-1.0, min(1.0, value(values, k))) for k in range(4)]
        self._sticks = tuple(0.0 if math.isnan(v) or abs(v) < DEAD else v for v in given)  # type: ignore[assignment]
        self._age = 0.0

    def step(self, pilot: "Pilot", dt: float) -> None:
        """Fly as the sticks say; hold the place when they are in the middle."""
        self._age += dt
        forward, left, up, yaw = self._sticks if self._age < STICK_TIMEOUT else (0.0, 0.0, 0.0, 0.0)
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
        elif self._place is None and norm(guide.velocity) < DEAD:
            self._place = guide.position
        guide.along(velocity if self._place is None else guide.towards(self._place, limits), limits, dt)
        guide.turn_at(yaw * limits.yaw_rate, limits, dt)
