"""The scene's `[trajectory]`."""

from lapwing.services.autopilot.commander.commander_input import Constants
from lapwing.services.autopilot.commander.flight_mode import FlightMode
from lapwing.services.autopilot.commander.guidance import Guidance

NAME = "trajectory"


class Mode(FlightMode):
    """Trajectory mode, which cannot be entered again."""

    def __init__(self, constants: Constants, guidance: Guidance, *values: float):
        raise ValueError("trajectory: the trajectory of the scene cannot be resumed")
