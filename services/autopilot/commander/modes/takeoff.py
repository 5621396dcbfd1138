"""Take-off."""

import math

from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.commander.flight_mode import FlightMode, value
from lapwing.services.autopilot.commander.guidance import Guidance
from lapwing.services.common.plans.route_checks import MAXIMUM_TAKEOFF_HEIGHT

NAME = "takeoff"
REACHED = 0.1  # [m]


class Mode(FlightMode):
    """Climb vertically, then hold. Values: world z [m], default MIS_TAKEOFF_ALT above home; yaw [rad]."""

    def __init__(self, constants: Constants, guidance: Guidance, *values: float):
        requested, ground = value(values, 0), constants.resting_height
        self._height = guidance.above_home(constants, "MIS_TAKEOFF_ALT") if math.isnan(requested) else requested
        if not ground < self._height <= MAXIMUM_TAKEOFF_HEIGHT:
            limits = f"{ground:g} to {MAXIMUM_TAKEOFF_HEIGHT:g} m"
            raise ValueError(f"take-off: expected a height from {limits}, got {self._height:g} m")
        if guidance.flying and guidance.smoothing.position[2] > self._height:
            raise ValueError(f"take-off: the vehicle is already above {self._height:g} m")
        self._yaw = value(values, 1)
        self._phase = f"climb to {guidance.words(constants, (*guidance.home[:2], self._height))}"

    @property
    def phase(self) -> str:
        """Text of the target height."""
        return self._phase

    def step(self, constants: Constants, view: CommanderInput, guidance: Guidance) -> None:
        """Climb once the motors are armed."""
        if not guidance.armed:
            return
        guidance.lift_off(constants, view)
        smoothing, limits = guidance.smoothing, guidance.limits
        x, y, _ = smoothing.position
        slow = limits._replace(up=min(guidance.parameters["MPC_TKO_SPEED"], limits.up))
        smoothing.move_to((x, y, self._height), slow, view.dt)
        smoothing.turn_to(self._yaw, slow, view.dt)
        if abs(smoothing.position[2] - self._height) < REACHED:
            self.next_mode = "hold"
