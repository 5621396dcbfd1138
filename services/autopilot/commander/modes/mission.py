"""The uploaded mission, item by item."""

import math
from itertools import islice
from typing import Any

from lapwing.dynamics.vector import ZERO, Vec3, norm, subtract
from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.commander.flight_mode import FlightMode, fill_in, value
from lapwing.services.autopilot.commander.guidance import Guidance
from lapwing.services.autopilot.commander.leg import Leg, Place, passing_speed
from lapwing.services.autopilot.commander.modes import land, return_, takeoff
from lapwing.services.autopilot.commander.route import GRAB, INSTANT, TO_PLACES
from lapwing.services.autopilot.commander.smoothing import wrap_angle

NAME = "mission"
ARRIVED = 0.05  # [m]
EXACT_RADIUS = 0.2  # [m] to wait or land somewhere the vehicle must be there
LANDED_TIME = 1.0  # [s] on the ground before the next item is begun
FORESIGHT = 32  # items that are looked through for the places to come
_NOT_GIVEN = (math.nan, math.nan, math.nan)


class Mode(FlightMode):
    """Flies the route from its current item, or from the one given."""

    def __init__(self, constants: Constants, guidance: Guidance, *values: float):
        route = guidance.route
        if not route.items:
            raise ValueError("mission: there is none; upload one first")
        first = value(values, 0)
        if math.isfinite(first) and first >= 0.0:
            route.select(int(first))
        elif route.item is None or (route.on_last and not guidance.flying):
            route.restart()
        self._number: int | None = None
        self._time_there = 0.0  # [s] since the item's place was reached
        self._item_mode: FlightMode | None = None  # another mode that flies the item
        self._leg = Leg(ZERO, ZERO)  # to the item's place
        self._yaw = math.nan  # that the item asks for [rad]
        self._last_waypoint: Vec3 | None = None  # [m]
        self._count = len(route.items)

    @property
    def phase(self) -> str:
        """Which item."""
        return "complete" if self._number is None else f"item {self._number + 1} of {self._count}"

    def step(self, constants: Constants, view: CommanderInput, guidance: Guidance) -> None:
        """Fly the current item, or go on with the next."""
        route = guidance.route
        if not guidance.armed:
            return
        item = self._after_instant_items(constants, view, guidance)
        if item is None:
            self._number = None
            self._stay(view, guidance)
            return
        if not guidance.flying and item.action in TO_PLACES:
            guidance.lift_off(constants, view)  # a mission without a take-off starts from the ground all the same
        if route.current != self._number:
            self._begin(constants, guidance, item)
        if self._fly(constants, view, guidance, item):
            route.advance()

    def _after_instant_items(self, constants: Constants, view: CommanderInput, guidance: Guidance) -> Any:
        """Do what takes no time; the item that comes then, None at the end."""
        route = guidance.route
        for _ in route.items:
            item = route.item
            if item is None or not _instant(item):
                break
            _act(constants, view, guidance, item)
            route.advance()
        return route.item

    def _stay(self, view: CommanderInput, guidance: Guidance) -> None:
        """The mission is over: hold where its last waypoint is, whose radius may have been wide."""
        smoothing, last = guidance.smoothing, self._last_waypoint
        if last is None or not guidance.flying or norm(subtract(last, smoothing.position)) < ARRIVED:
            self.next_mode = "hold"
        else:
            smoothing.move_to(last, guidance.limits, view.dt)
            smoothing.turn_at(0.0, guidance.limits, view.dt)

    def _begin(self, constants: Constants, guidance: Guidance, item: Any) -> None:
        self._number, self._time_there, self._item_mode = guidance.route.current, 0.0, None
        self._yaw = item.yaw + (guidance.smoothing.yaw if item.action == "yaw" and item.values else 0.0)  # relative
        if item.action == "takeoff":
            given = math.isfinite(item.position.z)
            asked = item.position.z if given else guidance.above_home(constants, "MIS_TAKEOFF_ALT")
            height = max(constants.resting_height + 0.1, asked)
            if not (guidance.flying and guidance.smoothing.position[2] >= height):
                self._item_mode = takeoff.Mode(constants, guidance, height, item.yaw)
        elif item.action == "return" and guidance.flying:
            self._item_mode = return_.Mode(constants, guidance)
        else:
            self._leg = self._leg_to(guidance, item)
            if item.action in TO_PLACES:
                self._last_waypoint = self._leg.target

    def _leg_to(self, guidance: Guidance, item: Any) -> Leg:
        """The way to the item's place: along the line from the waypoint before, on through it where nothing stops."""
        here = guidance.smoothing.position
        target, start = _place(item, here), here
        if item.action == "condition":  # what follows is flown to meanwhile
            places = [i for i in islice(guidance.route.following(), FORESIGHT) if i.action in TO_PLACES]
            return Leg(here, _place(places[0], here) if places else here)
        if (
            self._last_waypoint is not None
            and norm(subtract(self._last_waypoint, here)) < 2.0 * guidance.parameters["NAV_ACC_RAD"]
        ):
            start = self._last_waypoint
        ahead: list[Place] = [(target, _radius(guidance, item))]
        before = item
        for after in islice(guidance.route.following(), FORESIGHT):
            if _instant(after):
                continue
            if not _flown_through(before) or after.action not in (*TO_PLACES, "land"):
                break
            place = _place(after, ahead[-1][0])
            if place != ahead[-1][0]:
                ahead.append((place, _radius(guidance, after)))
            before = after
        return Leg(start, target, passing_speed(start, ahead, guidance.limits))

    def _fly(self, constants: Constants, view: CommanderInput, guidance: Guidance, item: Any) -> bool:
        """Move the setpoint for one tick; whether the item is done."""
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
        self._leg.step(guidance, self._yaw, view.dt)
        if item.action == "condition":
            self._time_there += view.dt
            left = norm(subtract(self._leg.target, guidance.smoothing.position))
            return left < max(item.radius, ARRIVED) or 0.0 < item.hold <= self._time_there
        if self._time_there == 0.0 and not self._reached(guidance, item):
            return False
        if item.action == "loiter_to_alt" and self._leg.target[2] != item.position.z and math.isfinite(item.position.z):
            self._leg = Leg(self._leg.target, (*self._leg.target[:2], item.position.z))
            return False
        if item.action == "loiter":
            return False
        if item.action == "land":
            self._item_mode = land.Mode(constants, guidance)
            return False
        self._time_there += view.dt
        return self._time_there >= item.hold

    def _reached(self, guidance: Guidance, item: Any) -> bool:
        """Whether the item's place and yaw are reached."""
        smoothing = guidance.smoothing
        aligned = math.isnan(self._yaw) or abs(wrap_angle(self._yaw - smoothing.yaw)) < guidance.yaw_tolerance
        return norm(subtract(self._leg.target, smoothing.position)) < _radius(guidance, item) and aligned


def _radius(guidance: Guidance, item: Any) -> float:
    """Distance [m] within which an item's place is reached."""
    radius = item.radius if item.radius > 0.0 else guidance.parameters["NAV_ACC_RAD"]
    return radius if _flown_through(item) else min(radius, EXACT_RADIUS)


def _flown_through(item: Any) -> bool:
    """Whether nothing of the item itself asks for a stop at its place."""
    return item.action in ("waypoint", "loiter_time") and item.hold == 0.0


def _instant(item: Any) -> bool:
    """Whether an item takes no time: what has nothing to do here is a delay of no length."""
    return item.action in INSTANT or (item.action == "delay" and item.hold == 0.0)


def _place(item: Any, here: Vec3) -> Vec3:
    """Where an item leads [m]; a coordinate that it does not give is that of `here`."""
    asked = tuple(item.position) if item.action in (*TO_PLACES, "land") else _NOT_GIVEN
    x, y, z = fill_in(here, asked)
    return x, y, here[2] if item.action in ("land", "loiter_to_alt") else z  # horizontally first


def _act(constants: Constants, view: CommanderInput, guidance: Guidance, item: Any) -> None:
    """Do what an item asks for that takes no time."""
    place = tuple(item.position)
    if item.action == "speed":
        guidance.speed = item.values[0]
    elif item.action == "roi":
        guidance.roi = (place[0], place[1], place[2]) if all(map(math.isfinite, place[:2])) else None
    elif item.action == "gripper":
        guidance.released = item.values[:1] != (GRAB,)
    elif item.action == "set_home":
        x, y, z = view.estimate.position_world
        guidance.home = fill_in((x, y, z - constants.resting_height), (place[0], place[1], place[2]))
