"""Down to the ground, where it is."""

from lapwing.dynamics.vector import ZERO
from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.commander.flight_mode import FlightMode
from lapwing.services.autopilot.commander.guidance import Guidance
from lapwing.services.autopilot.commander.smoothing import braking_speed

NAME = "land"
SLOW_HEIGHT = 3.0  # [m] above the ground, as estimated; below it the last metres begin
STOPPED = 0.05  # [m/s]


def descent_speed(constants: Constants, guidance: Guidance, altitude: float) -> float:
    """Speed [m/s] of going down at an altitude: world z [m]."""
    limits, slow = guidance.limits, guidance.parameters["MPC_LAND_SPEED"]
    above = max(0.0, altitude - constants.resting_height - SLOW_HEIGHT)
    return max(slow, min(limits.down, slow + braking_speed(above, limits.acceleration)))


class Mode(FlightMode):
    """Sink until the ground is felt: how high the vehicle is may be wrong."""

    needs_flight = True

    def __init__(self, constants: Constants, guidance: Guidance, *values: float):
        self._place: tuple[float, float] | None = None

    def step(self, constants: Constants, view: CommanderInput, guidance: Guidance) -> None:
        """Stop where it is, and sink."""
        if not guidance.flying:
            return
        smoothing, limits = guidance.smoothing, guidance.limits
        x, y, z = smoothing.position
        speed = descent_speed(constants, guidance, z)
        slowed = limits._replace(down=speed)
        if self._place is None:
            vx, vy, _ = ZERO
            if abs(smoothing.velocity[0]) + abs(smoothing.velocity[1]) < STOPPED:
                self._place = (x, y)
        else:
            vx, vy, _ = smoothing.velocity_to((*self._place, z), slowed)
        smoothing.move_at((vx, vy, -speed), slowed, view.dt)
        smoothing.turn_at(0.0, limits, view.dt)
