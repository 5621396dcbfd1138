"""Circular flight around a position, as in PX4."""

from lapwing.dynamics.vector import Vec3
from lapwing.kernels import math
from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.commander.flight_mode import FlightMode, fill_in, value, vector
from lapwing.services.autopilot.commander.guidance import Guidance
from lapwing.services.autopilot.commander.smoothing import clamp_norm
from lapwing.services.common.plans.route_checks import LEAST_RADIUS, MOST_RADIUS, ORBIT_RADIUS

NAME = "orbit"
TO_CENTRE, INITIAL, FREE, TANGENT, STICKS, UNCHANGED = range(6)  # ORBIT_YAW_BEHAVIOUR
SPEED, MOST_ACCELERATION = 1.0, 2.0  # [m/s], [m/s^2] towards the centre
GAIN = 1.0  # [1/s] speed towards the circle over distance


class Mode(FlightMode):
    """Values: x, y, z of the centre [m], radius [m], speed to the left [m/s], yaw behaviour, turns [rad]."""

    needs_flight = True

    def __init__(self, constants: Constants, guidance: Guidance, *values: float):
        self._centre = fill_in(guidance.smoothing.position, vector(values, 0))
        radius, speed, behaviour, turns = (value(values, k) for k in range(3, 7))
        self._radius = ORBIT_RADIUS if math.isnan(radius) else radius
        if not LEAST_RADIUS <= self._radius <= MOST_RADIUS:
            raise ValueError(f"orbit: expected a radius from {LEAST_RADIUS:g} to {MOST_RADIUS:g} m")
        if not all(map(math.isfinite, self._centre)) or self._centre[2] <= constants.resting_height:
            raise ValueError("orbit: expected a position above the ground")
        limit = min(math.sqrt(MOST_ACCELERATION * self._radius), guidance.limits.horizontal)
        self._speed = max(-limit, min(limit, -SPEED if math.isnan(speed) else speed))
        self._behaviour = TO_CENTRE if math.isnan(behaviour) or behaviour == UNCHANGED else int(behaviour)
        self._turns_left = turns if turns > 0.0 else math.inf

    def step(self, constants: Constants, view: CommanderInput, guidance: Guidance) -> None:
        """Fly to the circle and along it."""
        smoothing, limits = guidance.smoothing, guidance.limits
        x, y, _z = smoothing.position
        dx, dy = x - self._centre[0], y - self._centre[1]
        distance = math.hypot(dx, dy)
        ux, uy = (dx / distance, dy / distance) if distance > 1e-6 else (1.0, 0.0)
        out = GAIN * (self._radius - distance)
        near = abs(out) < 1.0
        along = self._speed if near else 0.0
        # Compensates the lag of the smoothed setpoint.
        lead = along * along / max(distance, LEAST_RADIUS) / 3.0
        velocity: Vec3 = ((out - lead) * ux - along * uy, (out - lead) * uy + along * ux, 0.0)
        vertical = smoothing.velocity_to((x, y, self._centre[2]), limits)[2]
        vx, vy, _ = clamp_norm(velocity, limits.horizontal)
        smoothing.move_at((vx, vy, vertical), limits, view.dt)
        smoothing.turn_to(self._yaw(ux, uy), limits, view.dt)
        if near:
            self._turns_left -= abs(along) * view.dt / self._radius
        if self._turns_left <= 0.0:
            self.next_mode = "hold"

    def _yaw(self, ux: float, uy: float) -> float:
        if self._behaviour == TO_CENTRE:
            return math.atan2(-uy, -ux)
        if self._behaviour == TANGENT:
            sign = math.copysign(1.0, self._speed)
            return math.atan2(sign * ux, -sign * uy)
        return math.nan
