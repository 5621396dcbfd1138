"""Up, and then hold."""

import math
from typing import TYPE_CHECKING

from services.autopilot.commander.modes.base import FlightMode, value

if TYPE_CHECKING:
    from services.autopilot.commander.pilot import Pilot

NAME = "takeoff"
REACHED = 0.1  # [m]


class Mode(FlightMode):
    """Straight up to a height above home [m], at the yaw given or the present one."""

    def __init__(self, pilot: "Pilot", *values: float):
        asked = value(values, 0)
        self.height = pilot.parameters["MIS_TAKEOFF_ALT"] if math.isnan(asked) else asked
        if not pilot.ground < self.height <= 1000.0:
            raise ValueError(f"take-off: expected a height from {pilot.ground:g} to 1000 m, got {self.height:g} m")
        if pilot.flying and pilot.guide.position[2] > self.height:
            raise ValueError(f"take-off: is higher than {self.height:g} m already")
        self._yaw = value(values, 1)

    @property
    def phase(self) -> str:
        """The height that it climbs to."""
        return f"to {self.height:g} m"

    def step(self, pilot: "Pilot", dt: float) -> None:
        """Climb; the guide starts from the ground as soon as the motors are armed."""
        if not pilot.armed:
            return
        pilot.lift_off()
        guide = pilot.guide
        x, y, _ = guide.position
        limits = pilot.limits._replace(up=min(pilot.parameters["MPC_TKO_SPEED"], pilot.limits.up))
        guide.to((x, y, self.height), limits, dt)
        guide.turn_to(self._yaw, limits, dt)
        if abs(guide.position[2] - self.height) < REACHED:
            self.next = "hold"
