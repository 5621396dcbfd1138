"""Return home, to a rally point or to the mission's landing, by RTL_TYPE and within the geofence."""

from lapwing.dynamics.vector import norm, subtract
from lapwing.kernels import math
from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.commander.flight_mode import FlightMode
from lapwing.services.autopilot.commander.geofence_routing import Point, route_around
from lapwing.services.autopilot.commander.guidance import Guidance
from lapwing.services.autopilot.commander.leg import Leg

NAME = "return"
ACCEPTANCE_RADIUS = 0.3  # [m] around a corner of the path
OVERHEAD = 1.0  # [m] horizontal distance to the goal below which the vehicle does not climb
HOME_OR_RALLY, TO_LANDING, ALONG_MISSION, NEAREST = range(4)  # RTL_TYPE
_CLIMB, _CRUISE, _WAIT = "climb", "home", "wait"


class Mode(FlightMode):
    """Climb to the return altitude, fly to the goal, wait, land."""

    needs_flight = True

    def __init__(self, constants: Constants, guidance: Guidance, *values: float):
        x, y, z = guidance.smoothing.position
        path = _path(guidance)
        end = path[-1]
        overhead = len(path) == 1 and math.dist(end, (x, y)) < OVERHEAD
        height = z if overhead else max(z, guidance.above_home(constants, "RTL_RETURN_ALT"))
        self._corners = [(x, y, height), *((*corner, height) for corner in path)]
        self._landing_delay = guidance.parameters["RTL_LAND_DELAY"]
        if self._landing_delay != 0.0:
            self._corners.append((*end, min(height, guidance.above_home(constants, "RTL_DESCEND_ALT"))))
        self._index, self._wait_time = 0, 0.0
        self._leg = Leg(guidance.smoothing.position, self._corners[0])

    @property
    def phase(self) -> str:
        """Phase of the return: climb, home (flight to the goal), wait (above the landing position)."""
        return _WAIT if self._index == len(self._corners) else _CRUISE if self._index else _CLIMB

    def step(self, constants: Constants, view: CommanderInput, guidance: Guidance) -> None:
        """Fly from corner to corner, then land."""
        if not guidance.flying:
            return
        self._leg.step(guidance, math.nan, view.dt)
        if self._index == len(self._corners):
            self._wait_time += view.dt
            if 0.0 <= self._landing_delay <= self._wait_time:
                self.next_mode = "land"
        elif norm(subtract(self._leg.target, guidance.smoothing.position)) < ACCEPTANCE_RADIUS:
            self._index += 1
            if self._index < len(self._corners):
                self._leg = Leg(self._leg.target, self._corners[self._index])
            elif self._landing_delay == 0.0:
                self.next_mode = "land"


def _path(guidance: Guidance) -> list[Point]:
    """Return the corners [m] of the path back."""
    x, y, _ = guidance.smoothing.position
    kind, route = guidance.parameters["RTL_TYPE"], guidance.route
    landing = next(((k, i) for k, i in enumerate(route.items) if i.action == "land"), None)
    place = _place(landing[1]) if landing else None
    landing_points = [(x, y) for x, y, _ in (guidance.home, *guidance.rally_points)]
    if kind == ALONG_MISSION and route.items:
        if landing and place:
            ahead = [_place(i) for i in route.items[route.current : landing[0]]]
            return [*(p for p in ahead if p), place]
        behind = [_place(i) for i in reversed(route.items[: route.current])]
        return [*(p for p in behind if p), landing_points[0]]
    if place and kind in (TO_LANDING, ALONG_MISSION):
        goal = place
    else:
        goal = min(
            [*landing_points, *([place] if place and kind == NEAREST else [])], key=lambda p: math.dist(p, (x, y))
        )
    return route_around(guidance.fence, (x, y), goal)


def _place(item: object) -> Point | None:
    """Return the position of an item [m]. Return None if it has none."""
    action, position = item.action, item.position  # type: ignore[attr-defined]
    finite = math.isfinite(position.x) and math.isfinite(position.y)
    return (position.x, position.y) if finite and action in ("waypoint", "loiter_time", "land") else None
