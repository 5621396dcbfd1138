"""By hand without knowing where: the sticks ask for tilts, a vertical speed and a yaw rate."""

from typing import TYPE_CHECKING

from services.autopilot.commander.modes.base import FlightMode, stick
from services.autopilot.commander.modes.level import Level

if TYPE_CHECKING:
    from services.autopilot.commander.pilot import Pilot

NAME = "altitude_control"
SHARE = 0.6  # of the highest tilt at full stick: the rest is left to the wind


class Mode(FlightMode):
    """Sticks: forward, left, up, yaw rate, each from -1 to 1; let go of, it holds its height and drifts."""

    needs_flight, needs_position = True, False

    def __init__(self, pilot: "Pilot", *values: float):
        self._level = Level(pilot)

    def step(self, pilot: "Pilot", dt: float) -> None:
        """Fly as the sticks say; when nobody holds them any more, by itself."""
        if not pilot.flying:
            return
        if not pilot.sticks_fresh:
            self.next = "descend" if pilot.position_lost else "hold"
        forward, left, up, yaw = (stick(pilot, k) for k in range(4))
        limits, tilt = pilot.limits, SHARE * pilot.parameters["MPC_TILT_MAX"]
        climb = up * (limits.up if up > 0.0 else limits.down)
        self._level.step(pilot, dt, climb, yaw * limits.yaw_rate, (tilt * forward, tilt * left))
