"""Down to the ground, where it is."""

from typing import TYPE_CHECKING

from dynamics.vector import ZERO
from services.autopilot.commander.guide import approach
from services.autopilot.commander.modes.base import FlightMode

if TYPE_CHECKING:
    from services.autopilot.commander.pilot import Pilot

NAME = "land"
SLOW_HEIGHT = 3.0  # [m] above the ground, as estimated; below it the last metres begin


def sinking(pilot: "Pilot", height: float) -> float:
    """Speed [m/s] of going down at a height [m] of the world."""
    limits, slow = pilot.limits, pilot.parameters["MPC_LAND_SPEED"]
    above = max(0.0, height - pilot.ground - SLOW_HEIGHT)
    return max(slow, min(limits.down, slow + approach(above, limits.acceleration)))


class Mode(FlightMode):
    """Sink until the ground is felt: how high the vehicle is may be wrong."""

    needs_flight = True

    def __init__(self, pilot: "Pilot", *values: float):
        self._place: tuple[float, float] | None = None

    def step(self, pilot: "Pilot", dt: float) -> None:
        """Stop where it is, and sink."""
        if not pilot.flying:
            return
        guide, limits = pilot.guide, pilot.limits
        x, y, z = guide.position
        speed = sinking(pilot, z)
        across = limits._replace(down=speed)
        if self._place is None:
            vx, vy, _ = ZERO
            if abs(guide.velocity[0]) + abs(guide.velocity[1]) < 0.05:
                self._place = (x, y)
        else:
            vx, vy, _ = guide.towards((*self._place, z), across)
        guide.along((vx, vy, -speed), across, dt)
        guide.turn_at(0.0, limits, dt)
