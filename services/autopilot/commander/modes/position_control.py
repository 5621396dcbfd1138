"""Manual flight by velocities along the heading."""

from lapwing.dynamics.vector import ZERO, Vec3, norm
from lapwing.kernels import math
from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.commander.flight_mode import FlightMode
from lapwing.services.autopilot.commander.guidance import Guidance

NAME = "position_control"
STOPPED = 0.05  # [m/s] at which the position is held


class Mode(FlightMode):
    """Sticks: forward, left, up, yaw rate, each from -1 to 1."""

    def __init__(self, constants: Constants, guidance: Guidance, *values: float):
        self._position: Vec3 | None = None

    def step(self, constants: Constants, view: CommanderInput, guidance: Guidance) -> None:
        """Follow the sticks; hold the position when they are centred."""
        forward, left, up, yaw = (guidance.stick(k) for k in range(4))
        if not guidance.armed:
            return
        if up > 0.0:
            guidance.lift_off(constants, view)
        if not guidance.flying:
            return
        smoothing, limits = guidance.smoothing, guidance.manual_limits
        s, c = math.sincos(smoothing.yaw)
        vertical = up * (limits.up if up > 0.0 else limits.down)
        full = limits.horizontal
        velocity = (full * (c * forward - s * left), full * (s * forward + c * left), vertical)
        if velocity != ZERO:
            self._position = None
        elif self._position is None and norm(smoothing.velocity) < STOPPED:
            self._position = smoothing.position
        desired = velocity if self._position is None else smoothing.velocity_to(self._position, limits)
        smoothing.move_at(desired, limits, view.dt)
        smoothing.turn_at(yaw * limits.yaw_rate, limits, view.dt)
