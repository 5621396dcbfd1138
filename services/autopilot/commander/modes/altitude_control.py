"""Manual flight by tilts, vertical speed and yaw rate, without a position."""

from lapwing.services.autopilot.commander.altitude_flight import AltitudeFlight
from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.commander.flight_mode import FlightMode
from lapwing.services.autopilot.commander.guidance import Guidance
from lapwing.services.common.ports import Setpoint

NAME = "altitude_control"


class Mode(FlightMode):
    """Sticks: forward, left, up, yaw rate, each from -1 to 1; centred sticks keep the altitude."""

    needs_position = False

    def __init__(self, constants: Constants, guidance: Guidance, *values: float):
        self._flight = AltitudeFlight(guidance) if guidance.flying else None

    def step(self, constants: Constants, view: CommanderInput, guidance: Guidance) -> Setpoint | None:
        """Follow the sticks; change to hold or descend without recent sticks."""
        forward, left, up, yaw = (guidance.stick(k) for k in range(4))
        if up > 0.0:
            guidance.lift_off(constants, view)
        if not guidance.flying:
            self._flight = None
            return None
        self._flight = self._flight or AltitudeFlight(guidance)
        if not guidance.sticks_fresh:
            self.next_mode = "descend" if view.position_lost else "hold"
        limits, tilt = guidance.manual_limits, guidance.manual_tilt
        climb_rate = up * (limits.up if up > 0.0 else limits.down)
        tilts = (tilt * forward, tilt * left)
        return self._flight.step(constants, view, guidance, climb_rate, yaw * limits.yaw_rate, tilts)
