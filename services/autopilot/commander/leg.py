"""Flight along a straight leg: passing speed and heading."""

from collections.abc import Sequence

from lapwing.dynamics.vector import ZERO, Vec3, dot, norm, subtract
from lapwing.kernels import math
from lapwing.services.autopilot.commander.guidance import Guidance
from lapwing.services.autopilot.commander.smoothing import Limits, braking_speed, stopping_distance, wrap_angle

TOWARDS_TARGET, TOWARDS_HOME, AWAY_FROM_HOME, ALONG_VELOCITY, TURN_FIRST, STAY = range(6)  # MPC_YAW_MODE
_CLOSE = 0.5  # [m] distance below which a direction is undefined
_SLOW = 0.5  # [m/s] speed below which a direction is undefined

Waypoint = tuple[Vec3, float]  # [m] position, [m] acceptance radius


def corner_speed(before: Vec3, corner: Vec3, after: Vec3, radius: float, limits: Limits) -> float:
    """Return the speed [m/s] for rounding a corner within a radius [m], on the circle tangent to both legs."""
    a, b = subtract(corner, before), subtract(after, corner)
    product = norm(a) * norm(b)
    turn = math.acos(max(-1.0, min(1.0, dot(a, b) / product))) if product > 0.0 else 0.0
    # The circle's radius is r cot(turn / 2); half of the acceleration is left for braking.
    return math.sqrt(0.5 * limits.acceleration * radius / math.tan(0.5 * turn)) if turn > 1e-6 else math.inf


def passing_speed(start: Vec3, waypoints: Sequence[Waypoint], limits: Limits) -> float:
    """Return the speed [m/s] at the first waypoint that allows a stop at the last."""
    speed = 0.0
    points = [start, *(position for position, _ in waypoints)]
    for k in range(len(waypoints) - 1, 0, -1):
        distance = norm(subtract(points[k + 1], points[k])) + stopping_distance(speed, limits.acceleration)
        corner = corner_speed(points[k - 1], points[k], points[k + 1], waypoints[k - 1][1], limits)
        speed = min(
            corner, braking_speed(distance, limits.acceleration), max(limits.horizontal, limits.up, limits.down)
        )
    return speed


class Leg:
    """A straight leg of a route."""

    def __init__(self, start_world: Vec3, target_world: Vec3, passing_speed: float = 0.0):
        """Create a leg from start to target [m] with a speed [m/s] at its end."""
        self.start, self.target, self.passing_speed = start_world, target_world, passing_speed
        self._heading = math.nan

    def step(self, guidance: Guidance, yaw: float, dt: float) -> None:
        """Move the setpoint for a tick of dt [s] and turn it to a yaw [rad]; NaN: by MPC_YAW_MODE."""
        smoothing, limits = guidance.smoothing, guidance.limits
        desired = self._desired_yaw(guidance) if math.isnan(yaw) else yaw
        error = abs(wrap_angle(desired - smoothing.yaw))  # NaN compares as aligned
        if guidance.parameters["MPC_YAW_MODE"] == TURN_FIRST and error > guidance.yaw_tolerance:
            smoothing.move_at(ZERO, limits, dt)
        else:
            along = smoothing.velocity_along(self.start, self.target, self.passing_speed, limits)
            smoothing.move_at(along, limits, dt)
        smoothing.turn_to(desired, limits, dt)

    def _desired_yaw(self, guidance: Guidance) -> float:
        course = heading(guidance, self.target)
        self._heading = self._heading if math.isnan(course) else course
        return self._heading


def heading(guidance: Guidance, target_world: Vec3) -> float:
    """Return the yaw [rad] on the way to a position [m], NaN if undefined."""
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
    """Return the yaw [rad] towards the region of interest, NaN without one."""
    return math.nan if guidance.roi is None else _direction(guidance.smoothing.position, guidance.roi)


def _direction(start: Vec3, end: Vec3) -> float:
    x, y = end[0] - start[0], end[1] - start[1]
    return math.atan2(y, x) if math.hypot(x, y) > _CLOSE else math.nan
