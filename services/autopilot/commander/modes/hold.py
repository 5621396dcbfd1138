"""Stop, and stay there."""

from typing import TYPE_CHECKING

from dynamics.vector import ZERO, Vec3, norm
from services.autopilot.commander.modes.base import FlightMode

if TYPE_CHECKING:
    from services.autopilot.commander.pilot import Pilot

NAME = "hold"
STOPPED = 0.05  # [m/s]


class Mode(FlightMode):
    """Brake first, then hold the place where the guide has come to rest."""

    def __init__(self, pilot: "Pilot", *values: float):
        self._place: Vec3 | None = None

    def step(self, pilot: "Pilot", dt: float) -> None:
        """Brake or stay."""
        if not pilot.flying:
            return
        guide, limits = pilot.guide, pilot.limits
        if self._place is None:
            guide.along(ZERO, limits, dt)
            if norm(guide.velocity) < STOPPED:
                self._place = guide.position
        else:
            guide.to(self._place, limits, dt)
        guide.turn_at(0.0, limits, dt)
