"""Home, or to the nearest rally point: up, across, down."""

import math
from typing import TYPE_CHECKING

from dynamics.vector import norm, subtract
from services.autopilot.commander.modes.base import FlightMode

if TYPE_CHECKING:
    from services.autopilot.commander.pilot import Pilot

NAME = "return"
NEAR = 0.3  # [m] from a corner of the way to the next part
_PARTS = ("climb", "home")


class Mode(FlightMode):
    """Climb to the height of return (or stay where it is higher), cross, land."""

    needs_flight = True

    def __init__(self, pilot: "Pilot", *values: float):
        x, y, z = pilot.guide.position
        places = pilot.rally or ((*pilot.home, 0.0),)
        self._x, self._y, _ = min(places, key=lambda p: math.hypot(p[0] - x, p[1] - y))
        close = math.hypot(self._x - x, self._y - y) < 1.0
        height = z if close else max(z, pilot.parameters["RTL_RETURN_ALT"])
        self._corners = [(x, y, height), (self._x, self._y, height)]
        self._part = 0

    @property
    def phase(self) -> str:
        """Which part of the way."""
        return _PARTS[self._part]

    def step(self, pilot: "Pilot", dt: float) -> None:
        """One corner after the other, then land."""
        if not pilot.flying:
            return
        pilot.guide.to(self._corners[self._part], pilot.limits, dt)
        pilot.guide.turn_at(0.0, pilot.limits, dt)
        if norm(subtract(self._corners[self._part], pilot.guide.position)) < NEAR:
            if self._part == 1:
                self.next = "land"
            self._part = 1
