"""Position hold."""

import math

from lapwing.dynamics.vector import ZERO, Vec3, norm
from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.commander.flight_mode import FlightMode, value
from lapwing.services.autopilot.commander.guidance import Guidance
from lapwing.services.autopilot.commander.leg import towards_roi

NAME = "hold"
STOPPED = 0.05  # [m/s]


class Mode(FlightMode):
    """Brake, then hold the setpoint's position. Value: yaw [rad]; NaN: unchanged."""

    def __init__(self, constants: Constants, guidance: Guidance, *values: float):
        self._position: Vec3 | None = None
        self._yaw = value(values, 0)

    def step(self, constants: Constants, view: CommanderInput, guidance: Guidance) -> None:
        """Brake or hold."""
        if not guidance.flying:
            return
        smoothing, limits = guidance.smoothing, guidance.limits
        if self._position is None:
            smoothing.move_at(ZERO, limits, view.dt)
            if norm(smoothing.velocity) < STOPPED:
                self._position = smoothing.position
        else:
            smoothing.move_to(self._position, limits, view.dt)
        desired = towards_roi(guidance) if math.isnan(self._yaw) else self._yaw
        smoothing.turn_to(desired, limits, view.dt)
