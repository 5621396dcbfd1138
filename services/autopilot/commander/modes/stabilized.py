"""Manual flight by tilts, thrust and yaw rate; centred sticks level the vehicle."""

import math

from lapwing.dynamics.lie.quaternion import from_roll_pitch_yaw
from lapwing.services.autopilot.commander.attitude_flight import AttitudeFlight, stick_thrust
from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.commander.flight_mode import FlightMode
from lapwing.services.autopilot.commander.guidance import Guidance
from lapwing.services.common.ports import Setpoint

NAME = "stabilized"


class Mode(FlightMode):
    """Sticks: forward, left, thrust, yaw rate, each from -1 to 1; in the middle it hovers."""

    needs_position = False

    def __init__(self, constants: Constants, guidance: Guidance, *values: float):
        self._flight: AttitudeFlight | None = None

    def step(self, constants: Constants, view: CommanderInput, guidance: Guidance) -> Setpoint | None:
        """Follow the sticks; change to hold or descend without recent sticks."""
        forward, left, up, turn = (guidance.stick(k) for k in range(4))
        thrust = stick_thrust(constants, up)
        if not guidance.flying:
            if guidance.armed and thrust > constants.hover_thrust:
                guidance.lift_off(constants, view)
            self._flight = None
            return None
        if not guidance.sticks_fresh:
            self.next_mode = "descend" if view.position_lost else "hold"
        self._flight = self._flight or AttitudeFlight(view)
        rate = self._turn(view, guidance, forward, left, turn, self._flight)
        return self._flight.setpoint(constants, view, guidance, rate, thrust, 0.0)

    def _turn(
        self, view: CommanderInput, guidance: Guidance, forward: float, left: float, turn: float, flight: AttitudeFlight
    ) -> float:
        """Rotate the attitude for a tick. Return its yaw rate [rad/s]."""
        tilt, rate = guidance.manual_tilt, turn * math.radians(guidance.parameters["MPC_MAN_Y_MAX"])
        flight.set_attitude(from_roll_pitch_yaw(-tilt * left, tilt * forward, flight.yaw + rate * view.dt), guidance)
        return rate
