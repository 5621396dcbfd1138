"""Flight of the uploaded mission."""

import math
from typing import Any

from lapwing.dynamics.vector import ZERO, Vec3, norm, subtract
from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.commander.flight_mode import FlightMode, fill_in, value
from lapwing.services.autopilot.commander.guidance import Guidance
from lapwing.services.autopilot.commander.leg import Leg, Waypoint, passing_speed
from lapwing.services.autopilot.commander.modes import land, orbit, return_, takeoff
from lapwing.services.autopilot.commander.route import GRAB
from lapwing.services.autopilot.commander.smoothing import wrap_angle
from lapwing.services.common import status_texts
from lapwing.services.common.plans.route_checks import ORBIT, TO_PLACES, breach_of, is_instant

NAME = "mission"
ARRIVED = 0.05  # [m]
EXACT_RADIUS = 0.2  # [m] maximum acceptance radius for waiting or landing
LEAST_HEIGHT = 0.1  # [m] over the ground
LANDED_TIME = 1.0  # [s] on the ground before the next item
FORESIGHT = 32  # items searched for the next positions
_QUARTER = 0.5 * math.pi  # [rad]
_NO_POSITION = (math.nan, math.nan, math.nan)


class Mode(FlightMode):
    """Flies the route. Value: first item; default: the current one."""

    def __init__(self, constants: Constants, guidance: Guidance, *values: float):
        route = guidance.route
        if not route.items:
            raise ValueError("mission: no mission is uploaded; upload one first")
        for number, item in enumerate(route.items, start=1):
            if breach := breach_of(guidance.fence, item):
                raise ValueError(f"mission: item {number} is {breach}; move the item or the fence")
        first = value(values, 0)
        if math.isfinite(first) and first >= 0.0:
            route.select(int(first))
        elif route.item is None or (route.on_last and not guidance.flying):
            route.restart()
        self._number: int | None = None
        self._phase = "complete"
        self._time_there = 0.0  # [s] since the item's position was reached
        self._item_mode: FlightMode | None = None  # another mode that flies the item
        self._leg = Leg(ZERO, ZERO)  # to the item's position
        self._yaw = math.nan  # [rad] of the item
        self._last_waypoint: Vec3 | None = None  # [m]
        self._count = len(route.items)

    @property
    def phase(self) -> str:
        """Text of the current item."""
        return self._phase

    def step(self, constants: Constants, view: CommanderInput, guidance: Guidance) -> None:
        """Fly the current item, or continue with the next."""
        route = guidance.route
        if not guidance.armed:
            return
        item = self._after_instant_items(constants, view, guidance)
        if item is None:
            self._number, self._phase = None, "complete"
            self._stay(view, guidance)
            return
        if not guidance.flying and item.action in (*TO_PLACES, ORBIT):
            guidance.lift_off(constants, view)  # a mission may start without a take-off item
        if route.current != self._number:
            self._begin(constants, guidance, item)
        if self._fly(constants, view, guidance, item):
            route.advance()

    def _after_instant_items(self, constants: Constants, view: CommanderInput, guidance: Guidance) -> Any:
        """Execute instant items. Return the next item, None at the end."""
        route = guidance.route
        for _ in route.items:
            item = route.item
            if item is None or not is_instant(item):
                break
            _act(constants, view, guidance, item)
            route.advance()
        return route.item

    def _stay(self, view: CommanderInput, guidance: Guidance) -> None:
        """Fly to the last waypoint, which may have a wide radius, and hold."""
        smoothing, last = guidance.smoothing, self._last_waypoint
        if last is None or not guidance.flying or norm(subtract(last, smoothing.position)) < ARRIVED:
            self.next_mode = "hold"
        else:
            smoothing.move_to(last, guidance.limits, view.dt)
            smoothing.turn_at(0.0, guidance.limits, view.dt)

    def _begin(self, constants: Constants, guidance: Guidance, item: Any) -> None:
        self._number, self._time_there, self._item_mode = guidance.route.current, 0.0, None
        self._yaw = _turned(item, guidance.smoothing.yaw) if item.action == "yaw" and item.values else item.yaw
        if item.action == "takeoff":
            finite = math.isfinite(item.position.z)
            altitude = item.position.z if finite else guidance.above_home(constants, "MIS_TAKEOFF_ALT")
            height = max(constants.resting_height + LEAST_HEIGHT, altitude)
            if not (guidance.flying and guidance.smoothing.position[2] >= height):
                self._item_mode = takeoff.Mode(constants, guidance, height, item.yaw)
        elif item.action == "return" and guidance.flying:
            self._item_mode = return_.Mode(constants, guidance)
        elif item.action == ORBIT:
            self._item_mode, self._last_waypoint = _orbit(constants, guidance, item), None
        else:
            self._leg = self._leg_to(guidance, item)
            if item.action in TO_PLACES:
                self._last_waypoint = self._leg.target
        self._phase = self._numbered(self._words(constants, guidance, item))

    def _numbered(self, text: str) -> str:
        return f"item {(self._number or 0) + 1} of {self._count}: {text}"

    def _words(self, constants: Constants, guidance: Guidance, item: Any) -> str:
        """Return the item in words."""
        if item.action in TO_PLACES:
            return f"go to {guidance.words(constants, self._leg.target)}"
        if isinstance(self._item_mode, takeoff.Mode):
            return self._item_mode.phase
        if item.action == ORBIT:
            return f"circle through {math.degrees(abs(item.values[0])):.0f}° with a radius of {item.radius:.3g} m"
        return {"return": "return home", "yaw": "turn", "condition": "fly on until a condition holds"}.get(
            item.action, str(item.action)
        )

    def _leg_to(self, guidance: Guidance, item: Any) -> Leg:
        """Return the leg to the item's position, from the last waypoint, passed without a stop if possible."""
        here = guidance.smoothing.position
        target, start = _place(item, here), here
        if item.action == "condition":  # the next position is approached meanwhile
            places = [i for i in guidance.route.following(FORESIGHT) if i.action in TO_PLACES]
            return Leg(here, _place(places[0], here) if places else here)
        if (
            self._last_waypoint is not None
            and norm(subtract(self._last_waypoint, here)) < 2.0 * guidance.parameters["NAV_ACC_RAD"]
        ):
            start = self._last_waypoint
        ahead: list[Waypoint] = [(target, _radius(guidance, item))]
        before = item
        for after in guidance.route.following(FORESIGHT):
            if is_instant(after):
                continue
            if not _needs_no_stop(before) or after.action not in (*TO_PLACES, "land"):
                break
            place = _place(after, ahead[-1][0])
            if place != ahead[-1][0]:
                ahead.append((place, _radius(guidance, after)))
            before = after
        return Leg(start, target, passing_speed(start, ahead, guidance.limits))

    def _fly(self, constants: Constants, view: CommanderInput, guidance: Guidance, item: Any) -> bool:
        """Move the setpoint for one tick. Return True if the item is done."""
        if item.action in ("land", "return") and not guidance.flying:
            self._time_there += view.dt
            return self._time_there > LANDED_TIME
        if self._item_mode is not None:
            self._item_mode.step(constants, view, guidance)
            if self._item_mode.next_mode == "land":
                self._item_mode = land.Mode(constants, guidance)
            return self._item_mode.next_mode == "hold"
        if item.action == "takeoff":
            return True
        yaw = self._yaw
        if item.action == "yaw" and item.values:  # by the demanded way, which may be the longer one
            yaw = guidance.smoothing.yaw + max(-_QUARTER, min(_QUARTER, self._yaw - guidance.smoothing.yaw))
        self._leg.step(guidance, yaw, view.dt)
        if item.action == "condition":
            self._time_there += view.dt
            left = norm(subtract(self._leg.target, guidance.smoothing.position))
            return left < max(item.radius, ARRIVED) or 0.0 < item.hold_time <= self._time_there
        if self._time_there == 0.0 and not self._is_reached(guidance, item):
            return False
        if item.action == "loiter_to_alt" and self._leg.target[2] != item.position.z and math.isfinite(item.position.z):
            self._leg = Leg(self._leg.target, (*self._leg.target[:2], item.position.z))
            return False
        if item.action == "loiter":
            place = guidance.words(constants, self._leg.target)
            self._phase = self._numbered(f"{status_texts.HOLDING} {place}")
            return False
        if item.action == "land":
            self._item_mode = land.Mode(constants, guidance)
            return False
        self._time_there += view.dt
        return self._time_there >= item.hold_time

    def _is_reached(self, guidance: Guidance, item: Any) -> bool:
        """Return True if position and yaw of the item are reached."""
        smoothing = guidance.smoothing
        left = self._yaw - smoothing.yaw
        left = left if item.action == "yaw" and item.values else wrap_angle(left)
        aligned = math.isnan(self._yaw) or abs(left) < guidance.yaw_tolerance
        return norm(subtract(self._leg.target, smoothing.position)) < _radius(guidance, item) and aligned


def _orbit(constants: Constants, guidance: Guidance, item: Any) -> orbit.Mode:
    """Return the circle of an item; without a speed as fast as its curvature allows."""
    x, y, z = fill_in(guidance.smoothing.position, tuple(item.position))
    angle, speed, behaviour = item.values[:3]
    to_left = math.copysign(math.inf if math.isnan(speed) else speed, angle)
    height = max(constants.resting_height + LEAST_HEIGHT, z)
    return orbit.Mode(constants, guidance, x, y, height, item.radius, to_left, behaviour, abs(angle))


def _turned(item: Any, yaw: float) -> float:
    """Return the yaw [rad], not wrapped, to which a relative or directed turn leads from a yaw."""
    relative, *direction = item.values
    if relative or not direction:
        return yaw + float(item.yaw)
    return yaw + math.copysign((direction[0] * (item.yaw - yaw)) % math.tau, direction[0])


def _radius(guidance: Guidance, item: Any) -> float:
    """Return the acceptance radius [m] of an item."""
    radius = item.radius if item.radius > 0.0 else guidance.parameters["NAV_ACC_RAD"]
    return radius if _needs_no_stop(item) else min(radius, EXACT_RADIUS)


def _needs_no_stop(item: Any) -> bool:
    """Return True if the item needs no stop at its position."""
    return item.action in ("waypoint", "loiter_time") and item.hold_time == 0.0


def _place(item: Any, here: Vec3) -> Vec3:
    """Return the position of an item [m]; missing coordinates are those of `here`."""
    requested = tuple(item.position) if item.action in (*TO_PLACES, "land") else _NO_POSITION
    x, y, z = fill_in(here, requested)
    return x, y, here[2] if item.action in ("land", "loiter_to_alt") else z  # horizontally first


def _act(constants: Constants, view: CommanderInput, guidance: Guidance, item: Any) -> None:
    """Execute an instant item."""
    place = tuple(item.position)
    if item.action == "speed":
        guidance.speed = item.values[0]
    elif item.action == "roi":
        guidance.roi = (place[0], place[1], place[2]) if all(map(math.isfinite, place[:2])) else None
    elif item.action == "gripper" and guidance.has_gripper:
        guidance.released = item.values[:1] != (GRAB,)
    elif item.action == "set_home":
        x, y, z = view.estimate.position_world
        guidance.home = fill_in((x, y, z - constants.resting_height), (place[0], place[1], place[2]))
