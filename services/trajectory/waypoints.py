"""Phases through waypoints: take-off, a leg to each point, landing."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import ConfigDict, Field

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.geodesy import Home
from lapwing.dynamics.validation import Table
from lapwing.dynamics.vector import ZERO
from lapwing.kernels import math
from lapwing.kernels.math import dist
from lapwing.services.common.schemas.place_schema import PlaceTable
from lapwing.services.trajectory.segments.segment import Finite, Positive

Point = Annotated[tuple[Finite, ...], Field(strict=False, min_length=3, max_length=4)]
Points = Annotated[tuple[Point, ...], Field(strict=False, min_length=1)]
PEAK = 1.875  # largest speed of a minimum-jerk motion over its mean
VERTICAL = 1.0  # [m/s] largest speed of take-off and landing
YAW_RATE = 1.0  # [rad/s] largest rate of the heading on a leg that ends with a stop
ACCELERATION = 2.0  # [m/s^2] a leg is curved, or changes its speed, within speed^2 / ACCELERATION of its ends
REST = 2.0  # [s] at the end
SHORTEST = 1e-3  # [m] between neighbouring points


class Waypoint(PlaceTable):
    """A waypoint as a table: a place in metres or on the Earth, and optionally a heading."""

    z: Finite  # [m] height above the ground at the start
    yaw_deg: Finite | None = None  # [deg] heading at the point, relative to that at the start, counter-clockwise

    def point(self, home: Home, start: tuple[float, float]) -> list[float]:
        """Return x, y, z [m] and, if it is given, the yaw [rad]. See `east_north` for arguments and errors."""
        place = [*self.east_north(home, start, self.z), self.z]
        return place if self.yaw_deg is None else [*place, math.radians(self.yaw_deg)]


class Route(Table):
    """Waypoints, and the manner of flight between them."""

    model_config = ConfigDict(strict=False)

    waypoints: Points = ()  # [m] x, y, z, instead of phases; or tables: x, y or latitude_deg, longitude_deg; z; yaw_deg
    speed: Positive = 2.0  # [m/s] largest speed between waypoints
    turn: Literal["stop", "round"] = "stop"  # stop at each waypoint, or pass it without a stop
    land: bool = True  # land below the last waypoint; otherwise the vehicle hovers there


def phases(route: Route) -> list[dict[str, Any]]:
    """Return the tables of the phases of a route.

    The vehicle climbs to the height of the first point and flies straight legs to the points, at most at `speed` [m/s].
    A fourth number of a point is its yaw [rad], which the vehicle turns to on the leg, the shorter way round.
    It stops at each point, or with turn = "round" passes it in the mean direction of its legs, the slower the sharper
    the turn, and leaves the straight line for it near the point.

    Raises:
        ConfigError: a point repeats the one before; the key is relative to the table.
    """
    points, speed = [point[:3] for point in route.waypoints], route.speed
    turns = _turns([point[3] if len(point) == 4 else None for point in route.waypoints])
    climb, slow = points[0][2], min(speed, VERTICAL)
    path = [(0.0, 0.0, climb), *points]
    if dist(path[0], path[1]) < SHORTEST:
        del path[0]
    result = [{"name": "take-off", "z": [_through(climb, PEAK * climb / slow)]}] if climb > 0.0 else []
    first = len(points) - len(path) + 2
    if first == 2 and turns[0]:  # the first point is above the start
        result.append({"name": "turn", "yaw": [_through(turns[0].end, PEAK * abs(turns[0].change) / YAW_RATE)]})
    for number, (a, b) in enumerate(pairwise(path), start=first):
        if dist(a, b) < SHORTEST:
            raise ConfigError(f"waypoints.{number - 1}", f"got {list(b)} like the point before", "another point")
    rates = _rates(path, speed if route.turn == "round" else 0.0)
    for number, ((a, b), (u, v)) in enumerate(zip(pairwise(path), pairwise(rates), strict=True), start=first):
        turn, straight = turns[number - 1], u == v == ZERO
        least = PEAK * abs(turn.change) / YAW_RATE if turn and straight else 0.0
        parts = [(b, max(PEAK * dist(a, b) / speed, least), u, v)] if straight else _parts(a, b, u, v, speed)
        channels = {
            channel: [_through(to[i], duration, first[i], last[i]) for to, duration, first, last in parts]
            for i, channel in enumerate("xyz")
        }
        if turn:
            channels["yaw"] = [_through(turn.end, math.total(duration for _, duration, *_ in parts))]
        result.append({"name": f"waypoint {number}", **channels})
    end = points[-1][2]
    if route.land and end > 0.0:
        result.append({"name": "landing", "z": [_through(0.0, PEAK * end / slow)]})
    return [*result, {"name": "rest" if route.land else "hover", "duration": REST}]


class _Turn(NamedTuple):
    end: float  # [rad] yaw at the end
    change: float  # [rad] along the shorter way


def _turns(yaws: Sequence[float | None]) -> list[_Turn | None]:
    """Return the turn on the leg to each point; None where the heading stays."""
    result: list[_Turn | None] = []
    previous = 0.0
    for yaw in yaws:
        change = 0.0 if yaw is None else math.atan2(*math.sincos(yaw - previous))
        previous += change
        result.append(_Turn(previous, change) if change else None)
    return result


def _rates(path: Sequence[Point], speed: float) -> list[Point]:
    """Return the velocity [m/s] at each point: the mean direction of its legs times the speed; rest at the ends."""
    legs = [tuple((q - p) / dist(a, b) for p, q in zip(a, b, strict=True)) for a, b in pairwise(path)]
    inner = [tuple(0.5 * speed * (p + q) for p, q in zip(a, b, strict=True)) for a, b in pairwise(legs)]
    return [ZERO, *((x, y, z) for x, y, z in inner), *[ZERO] * (len(path) > 1)]


def _parts(a: Point, b: Point, u: Point, v: Point, speed: float) -> list[tuple[Point, float, Point, Point]]:
    """Return end, duration [s] and velocities at both ends [m/s] of the parts of a leg: straight between two curves."""
    length = dist(a, b)
    along = tuple((q - p) / length for p, q in zip(a, b, strict=True))
    cruise = tuple(speed * each for each in along)
    reach = min(speed * speed / ACCELERATION, 0.5 * length)
    reach = reach if length - 2.0 * reach > SHORTEST else 0.5 * length
    first, last = (tuple(p + way * each for p, each in zip(a, along, strict=True)) for way in (reach, length - reach))
    paces = [0.5 * (speed + math.total(p * q for p, q in zip(end, along, strict=True))) for end in (u, v)]  # along it
    middle = [(last, (length - 2.0 * reach) / speed, cruise, cruise)] if 2.0 * reach < length else []
    return [(first, reach / paces[0], u, cruise), *middle, (b, reach / paces[1], cruise, v)]


def _through(to: float, duration: float, first: float = 0.0, last: float = 0.0) -> dict[str, Any]:
    return {"kind": "through", "to": to, "duration": duration, "start_rate": first, "end_rate": last}
