"""Flight along a straight leg: how fast its end may be passed, and where the nose points meanwhile."""

import math
from collections.abc import Sequence

from lapwing.dynamics.vector import ZERO, Vec3, dot, norm, subtract
from lapwing.services.autopilot.commander.guidance import Guidance
from lapwing.services.autopilot.commander.smoothing import Limits, braking_speed, stopping_distance, wrap_angle

TOWARDS_TARGET, TOWARDS_HOME, AWAY_FROM_HOME, ALONG_VELOCITY, TURN_FIRST, STAY = range(6)  # MPC_YAW_MODE
_CLOSE = 0.5  # [m] of the place that is faced, within which its direction is not told
_SLOW = 0.5  # [m/s] of the setpoint, below which it has no direction

Place = tuple[Vec3, float]  # [m], and the radius [m] within which it is reached


def corner_speed(before: Vec3, corner: Vec3, after: Vec3, radius: float, limits: Limits) -> float:
    """Speed [m/s] of rounding a corner within a radius [m], on the circle that touches both legs there."""
    a, b = subtract(corner, before), subtract(after, corner)
    product = norm(a) * norm(b)
    turn = math.acos(max(-1.0, min(1.0, dot(a, b) / product))) if product > 0.0 else 0.0
    # The circle's radius is r cot(turn / 2); half of the acceleration turns, the other half is left to brake.
    return math.sqrt(0.5 * limits.acceleration * radius / math.tan(0.5 * turn)) if turn > 1e-6 else math.inf


def passing_speed(start: Vec3, places: Sequence[Place], limits: Limits) -> float:
    """Speed [m/s] at which the first place may be passed so that the flight can stop at the last."""
    speed = 0.0
    points = [start, *(place for place, _ in places)]
    for k in range(len(places) - 1, 0, -1):
        room = norm(subtract(points[k + 1], points[k])) + stopping_distance(speed, limits.acceleration)
        corner = corner_speed(points[k - 1], points[k], points[k + 1], places[k - 1][1], limits)
        speed = min(corner, braking_speed(room, limits.acceleration), max(limits.horizontal, limits.up, limits.down))
    return speed


class Leg:
    """The way to a place, straight from where the last one was."""

    def __init__(self, start_world: Vec3, target_world: Vec3, passing_speed: float = 0.0):
        """To a place [m], from another; passed at a speed [m/s], or stopped at."""
        self.start, self.target, self.passing_speed = start_world, target_world, passing_speed
        self._heading = math.nan

    def step(self, guidance: Guidance, yaw: float, dt: float) -> None:
        """Move the setpoint for a tick of dt [s], and turn it to a yaw [rad]; NaN: as MPC_YAW_MODE says."""
        smoothing, limits = guidance.smoothing, guidance.limits
        wanted = self._wanted_yaw(guidance) if math.isnan(yaw) else yaw
        error = abs(wrap_angle(wanted - smoothing.yaw))  # NaN compares as aligned
        if guidance.parameters["MPC_YAW_MODE"] == TURN_FIRST and error > guidance.yaw_tolerance:
            smoothing.move_at(ZERO, limits, dt)
        else:
            along = smoothing.velocity_along(self.start, self.target, self.passing_speed, limits)
            smoothing.move_at(along, limits, dt)
        smoothing.turn_to(wanted, limits, dt)

    def _wanted_yaw(self, guidance: Guidance) -> float:
        found = heading(guidance, self.target)
        self._heading = self._heading if math.isnan(found) else found
        return self._heading


def heading(guidance: Guidance, target_world: Vec3) -> float:
    """Yaw [rad] of the nose on the way to a place [m], NaN where there is nothing to point at."""
    smoothing = guidance.smoothing
    mode = guidance.parameters["MPC_YAW_MODE"]
    if guidance.roi is not None:
        return towards_roi(guidance)
    if mode in (TOWARDS_HOME, AWAY_FROM_HOME):
        outwards = _direction(guidance.home, smoothing.position)
        return (
            outwards if mode == AWAY_FROM_HOME else wrap_angle(outwards + math.pi) if outwards == outwards else outwards
        )
    if mode == ALONG_VELOCITY:
        vx, vy, _ = smoothing.velocity
        return math.atan2(vy, vx) if math.hypot(vx, vy) > _SLOW else math.nan
    return math.nan if mode == STAY else _direction(smoothing.position, target_world)


def towards_roi(guidance: Guidance) -> float:
    """Yaw [rad] towards the region of interest, NaN where there is none."""
    return math.nan if guidance.roi is None else _direction(guidance.smoothing.position, guidance.roi)


def _direction(start: Vec3, end: Vec3) -> float:
    x, y = end[0] - start[0], end[1] - start[1]
    return math.atan2(y, x) if math.hypot(x, y) > _CLOSE else math.nan
