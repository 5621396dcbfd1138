"""By hand: the sticks ask for body rates and a thrust; let go of, it keeps the tilt that it has."""

import math

from lapwing.services.autopilot.commander.attitude_flight import AttitudeFlight
from lapwing.services.autopilot.commander.commander_input import CommanderInput
from lapwing.services.autopilot.commander.guidance import Guidance
from lapwing.services.autopilot.commander.modes import stabilized

NAME = "acro"


class Mode(stabilized.Mode):
    """Sticks: rates of pitch and roll, thrust, yaw rate. It tilts no further than MPC_TILTMAX_AIR: no loops."""

    def _turn(
        self, view: CommanderInput, guidance: Guidance, forward: float, left: float, turn: float, flight: AttitudeFlight
    ) -> float:
        p = guidance.parameters
        roll, pitch, yaw = (math.radians(p[f"MC_ACRO_{axis}_MAX"]) for axis in "RPY")
        flight.turn((-roll * left, pitch * forward, yaw * turn), guidance, view.dt)
        return yaw * turn
