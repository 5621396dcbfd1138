"""Home, or to the nearest rally point: up, across, down."""

import math

from dynamics.vector import norm, subtract
from services.autopilot.commander.flight_mode import FlightMode
from services.autopilot.commander.guidance import Guidance
from services.autopilot.commander.view import Constants, View

NAME = "return"
ACCEPTANCE_RADIUS = 0.3  # [m] around a corner of the way
OVERHEAD = 1.0  # [m] across from home, within which it does not climb
_PHASES = ("climb", "home")


class Mode(FlightMode):
    """Climb to the height of return (or stay where it is higher), cross, land."""

    needs_flight = True

    def __init__(self, constants: Constants, guidance: Guidance, *values: float):
        x, y, z = guidance.smoothing.position
        places = guidance.rally_points or ((*guidance.home, 0.0),)
        home_x, home_y, _ = min(places, key=lambda p: math.hypot(p[0] - x, p[1] - y))
        overhead = math.hypot(home_x - x, home_y - y) < OVERHEAD
        height = z if overhead else max(z, guidance.parameters["RTL_RETURN_ALT"])
        self._corners = [(x, y, height), (home_x, home_y, height)]
        self._index = 0

    @property
    def phase(self) -> str:
        """Which part of the way."""
        return _PHASES[self._index]

    def step(self, constants: Constants, view: View, guidance: Guidance) -> None:
        """One corner after the other, then land."""
        if not guidance.flying:
            return
        corner, smoothing = self._corners[self._index], guidance.smoothing
        smoothing.move_to(corner, guidance.limits, view.dt)
        smoothing.turn_at(0.0, guidance.limits, view.dt)
        if norm(subtract(corner, smoothing.position)) < ACCEPTANCE_RADIUS:
            if self._index == 1:
                self.next_mode = "land"
            self._index = 1
