"""Landing at the present position."""

from lapwing.dynamics.vector import ZERO
from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.commander.flight_mode import FlightMode
from lapwing.services.autopilot.commander.guidance import Guidance

NAME = "land"
STOPPED = 0.05  # [m/s]


def descent_speed(constants: Constants, guidance: Guidance, altitude: float) -> float:
    """Return the descent speed [m/s] at an altitude, world z [m], by PX4's three steps of a landing."""
    p, fast = guidance.parameters, guidance.limits.down
    height, slow = altitude - constants.resting_height - guidance.home[2], p["MPC_LAND_SPEED"]
    if constants.height_known and height <= p["MPC_LAND_ALT3"]:
        return p["MPC_LAND_CRWL"]
    high, low = p["MPC_LAND_ALT1"], p["MPC_LAND_ALT2"]
    share = (height - low) / (high - low) if high > low else float(height > low)
    return slow + min(max(share, 0.0), 1.0) * (fast - slow)


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
