"""Setpoints of altitude, heading and tilts, for flight without a position."""

from lapwing.kernels import math
from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.commander.guidance import Guidance
from lapwing.services.autopilot.commander.smoothing import PositionSmoothing
from lapwing.services.common.ports import Setpoint


class AltitudeFlight:
    """Moves altitude and heading; the horizontal setpoint is the estimate, so the wind integral does not change."""

    def __init__(self, guidance: Guidance):
        s = guidance.smoothing
        self._smoothing = PositionSmoothing((0.0, 0.0, s.position[2]), s.yaw, (0.0, 0.0, s.velocity[2]))

    @property
    def altitude(self) -> float:
        """Setpoint of world z [m]."""
        return self._smoothing.position[2]

    def step(
        self,
        constants: Constants,
        view: CommanderInput,
        guidance: Guidance,
        climb_rate: float,
        yaw_rate: float,
        tilts: tuple[float, float],
    ) -> Setpoint:
        """Return the setpoint of a tick and move `guidance` to it.

        Args:
            constants: constants of the vehicle.
            view: input with the estimate of this tick.
            guidance: its smoothed setpoint is replaced.
            climb_rate: vertical speed [m/s].
            yaw_rate: [rad/s].
            tilts: tilts forward and to the left [rad].
        """
        s, limits, e = self._smoothing, guidance.limits, view.estimate
        s.move_at((0.0, 0.0, climb_rate), limits, view.dt)
        s.turn_at(yaw_rate, limits, view.dt)
        forward, left = (constants.gravity * tilt for tilt in tilts)
        sin, cos = math.sincos(s.yaw)
        position = (*e.position_world[:2], s.position[2])
        velocity = (*e.velocity_world[:2], s.velocity[2])
        acceleration = (cos * forward - sin * left, sin * forward + cos * left, s.acceleration[2])
        setpoint = Setpoint(position, velocity, acceleration, s.yaw, s.yaw_rate)
        guidance.follow(setpoint)
        return setpoint
