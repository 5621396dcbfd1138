"""Landing at the present position."""

from lapwing.dynamics.vector import ZERO
from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.commander.flight_mode import FlightMode
from lapwing.services.autopilot.commander.guidance import Guidance
from lapwing.services.autopilot.commander.smoothing import braking_speed

NAME = "land"
SLOW_HEIGHT = 3.0  # [m] estimated height below which the descent is slow
STOPPED = 0.05  # [m/s]


def descent_speed(constants: Constants, guidance: Guidance, altitude: float) -> float:
    """Return the descent speed [m/s] at an altitude, world z [m]."""
    limits, slow = guidance.limits, guidance.parameters["MPC_LAND_SPEED"]
    above = max(0.0, altitude - constants.resting_height - SLOW_HEIGHT)
    return max(slow, min(limits.down, slow + braking_speed(above, limits.acceleration)))


class Mode(FlightMode):
    """Descend until the ground is detected; the estimated height may be wrong."""

    needs_flight = True

    def __init__(self, constants: Constants, guidance: Guidance, *values: float):
        self._position: tuple[float, float] | None = None

    def step(self, constants: Constants, view: CommanderInput, guidance: Guidance) -> None:
        """Stop horizontally and descend."""
        if not guidance.flying:
            return
        smoothing, limits = guidance.smoothing, guidance.limits
        x, y, z = smoothing.position
        speed = descent_speed(constants, guidance, z)
        descent_limits = limits._replace(down=speed)
        if self._position is None:
            vx, vy, _ = ZERO
            if abs(smoothing.velocity[0]) + abs(smoothing.velocity[1]) < STOPPED:
                self._position = (x, y)
        else:
            vx, vy, _ = smoothing.velocity_to((*self._position, z), descent_limits)
        smoothing.move_at((vx, vy, -speed), descent_limits, view.dt)
        smoothing.turn_at(0.0, limits, view.dt)
