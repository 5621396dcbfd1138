"""Down without knowing where: level but for what leans against the wind, as PX4's mode of this name does."""

from typing import TYPE_CHECKING

from services.autopilot.commander.modes.base import FlightMode
from services.autopilot.commander.modes.land import sinking
from services.autopilot.commander.modes.level import Level

if TYPE_CHECKING:
    from services.autopilot.commander.pilot import Pilot

NAME = "descend"
SURE = 1.0  # [s] for which the position must be known again


class Mode(FlightMode):
    """Sink until the ground is felt, or the vehicle knows again where it is: then wait for the operator, or land."""

    needs_flight, needs_position = True, False

    def __init__(self, pilot: "Pilot", *values: float):
        self._level = Level(pilot)
        self._known = 0.0  # [s]

    def step(self, pilot: "Pilot", dt: float) -> None:
        """One tick of dt [s]."""
        if not pilot.flying:
            return
        self._known = 0.0 if pilot.position_lost else self._known + dt
        if self._known > SURE:
            self.next = "hold" if pilot.operated else "land"
        self._level.step(pilot, dt, -sinking(pilot, self._level.height), 0.0, (0.0, 0.0))
