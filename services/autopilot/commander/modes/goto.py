"""To a place in the world, and stay there."""

import math
from typing import TYPE_CHECKING

from services.autopilot.commander.modes.base import FlightMode, tuple_of, value

if TYPE_CHECKING:
    from services.autopilot.commander.pilot import Pilot

NAME = "goto"


class Mode(FlightMode):
    """Values: x, y, z [m], yaw [rad], speed [m/s]; what is not given stays as it is."""

    needs_flight = True

    def __init__(self, pilot: "Pilot", *values: float):
        here = pilot.guide.position
        x, y, z = (value(values, k) for k in range(3))
        self._target = tuple_of(here, (x, y, z))
        if not all(map(math.isfinite, self._target)) or self._target[2] <= pilot.ground:
            raise ValueError("go to: expected a place above the ground")
        if not pilot.fence.allows(self._target[0], self._target[1]):
            raise ValueError("go to: the place is outside of the fence")
        self._yaw, speed = value(values, 3), value(values, 4)
        if speed > 0.0:
            pilot.speed = speed

    def step(self, pilot: "Pilot", dt: float) -> None:
        """Fly there."""
        pilot.guide.to(self._target, pilot.limits, dt)
        pilot.guide.turn_to(self._yaw, pilot.limits, dt)
