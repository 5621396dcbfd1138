"""Level descent without a position, as in PX4."""

from lapwing.services.autopilot.commander.altitude_flight import AltitudeFlight
from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.commander.flight_mode import FlightMode
from lapwing.services.autopilot.commander.guidance import Guidance
from lapwing.services.autopilot.commander.modes.land import descent_speed
from lapwing.services.common.ports import Setpoint

NAME = "descend"
RECOVERY_TIME = 1.0  # [s] of known position before the descent ends


class Mode(FlightMode):
    """Descend to the ground; once the position is known again, hold for an operator who waits, land without."""

    needs_flight, needs_position = True, False

    def __init__(self, constants: Constants, guidance: Guidance, *values: float):
        self._flight = AltitudeFlight(guidance)
        self._position_known = 0.0  # [s]

    def step(self, constants: Constants, view: CommanderInput, guidance: Guidance) -> Setpoint | None:
        """Descend for one tick."""
        if not guidance.flying:
            return None
        self._position_known = 0.0 if view.position_lost else self._position_known + view.dt
        if self._position_known > RECOVERY_TIME:
            waits = constants.has_operator and not guidance.finish_requested
            self.next_mode = "hold" if waits else "land"
        speed = descent_speed(constants, guidance, self._flight.altitude)
        return self._flight.step(constants, view, guidance, -speed, 0.0, (0.0, 0.0))
