"""Manual flight by body rates and thrust; centred sticks keep the tilt."""

import math

from lapwing.services.autopilot.commander.attitude_flight import AttitudeFlight
from lapwing.services.autopilot.commander.commander_input import CommanderInput
from lapwing.services.autopilot.commander.guidance import Guidance
from lapwing.services.autopilot.commander.modes import stabilized

NAME = "acro"


class Mode(stabilized.Mode):
    """Sticks: pitch and roll rate, thrust, yaw rate. The tilt is limited to MPC_TILTMAX_AIR."""

    def _turn(
        self, view: CommanderInput, guidance: Guidance, forward: float, left: float, turn: float, flight: AttitudeFlight
    ) -> float:
        p = guidance.parameters
        roll, pitch, yaw = (math.radians(p[f"MC_ACRO_{axis}_MAX"]) for axis in "RPY")
        flight.turn((-roll * left, pitch * forward, yaw * turn), guidance, view.dt)
        return yaw * turn
