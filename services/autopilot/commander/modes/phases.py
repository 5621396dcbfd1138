"""The scene's own `[trajectory]`, setpoint by setpoint."""

from typing import TYPE_CHECKING

from services.autopilot.commander.modes.base import FlightMode

if TYPE_CHECKING:
    from services.autopilot.commander.pilot import Pilot

NAME = "phases"


class Mode(FlightMode):
    """Follows the setpoints of the trajectory; once left, it is not entered again."""

    def __init__(self, pilot: "Pilot", *values: float):
        raise ValueError("phases: the trajectory of the scene has been left")
