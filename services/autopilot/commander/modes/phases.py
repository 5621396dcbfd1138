"""The scene's own `[trajectory]`, setpoint by setpoint."""

from services.autopilot.commander.flight_mode import FlightMode
from services.autopilot.commander.guidance import Guidance
from services.autopilot.commander.view import Constants

NAME = "phases"


class Mode(FlightMode):
    """Follows the setpoints of the trajectory; once left, it is not entered again."""

    def __init__(self, constants: Constants, guidance: Guidance, *values: float):
        raise ValueError("phases: the trajectory of the scene has been left")
