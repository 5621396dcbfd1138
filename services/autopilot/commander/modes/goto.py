"""Flight to a position."""

import math

from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.commander.flight_mode import FlightMode, fill_in, value, vector
from lapwing.services.autopilot.commander.guidance import Guidance
from lapwing.services.autopilot.commander.leg import Leg

NAME = "goto"


class Mode(FlightMode):
    """Values: x, y, z [m], yaw [rad], speed [m/s]; a missing coordinate is kept, a missing yaw is by MPC_YAW_MODE."""

    needs_flight = True

    def __init__(self, constants: Constants, guidance: Guidance, *values: float):
        self._target = fill_in(guidance.smoothing.position, vector(values, 0))
        if not all(map(math.isfinite, self._target)) or self._target[2] <= constants.resting_height:
            raise ValueError("go to: expected a position above the ground")
        if breach := guidance.breach(constants, self._target):
            raise ValueError(f"go to: the position is {breach}")
        self._leg = Leg(guidance.smoothing.position, self._target)
        self._phase = f"go to {guidance.words(constants, self._target)}"
        self._yaw, speed = value(values, 3), value(values, 4)
        if speed > 0.0:
            guidance.speed = speed

    @property
    def phase(self) -> str:
        """Text of the target, from home."""
        return self._phase

    def step(self, constants: Constants, view: CommanderInput, guidance: Guidance) -> None:
        """Follow the leg."""
        self._leg.step(guidance, self._yaw, view.dt)
