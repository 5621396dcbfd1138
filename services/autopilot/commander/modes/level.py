"""Flight that needs no position: a height, a heading, and tilts; what leans against the wind stays."""

import math
from typing import TYPE_CHECKING

from services.autopilot.commander.guide import Guide
from services.autopilot.interface import Setpoint

if TYPE_CHECKING:
    from services.autopilot.commander.pilot import Pilot


class Level:
    """Leads height and heading; across, the controller is told that it is where it wants to be."""

    def __init__(self, pilot: "Pilot"):
        g = pilot.guide
        self._guide = Guide((0.0, 0.0, g.position[2]), g.yaw, (0.0, 0.0, g.velocity[2]))

    @property
    def height(self) -> float:
        """World z that it is led to [m]."""
        return self._guide.position[2]

    def step(self, pilot: "Pilot", dt: float, climb: float, yaw_rate: float, tilts: tuple[float, float]) -> None:
        """One tick of dt [s].

        Args:
            pilot: who flies.
            dt: [s].
            climb: vertical speed [m/s].
            yaw_rate: [rad/s].
            tilts: forward and to the left [rad].
        """
        guide, limits, e = self._guide, pilot.limits, pilot.estimate
        guide.along((0.0, 0.0, climb), limits, dt)
        guide.turn_at(yaw_rate, limits, dt)
        forward, left = (pilot.gravity * tilt for tilt in tilts)
        s, c = math.sin(guide.yaw), math.cos(guide.yaw)
        place = (*e.position_world[:2], guide.position[2])
        velocity = (*e.velocity_world[:2], guide.velocity[2])
        acceleration = (c * forward - s * left, s * forward + c * left, guide.acceleration[2])
        pilot.follow(Setpoint(place, velocity, acceleration, guide.yaw, guide.yaw_rate))
