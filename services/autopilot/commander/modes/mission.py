"""The uploaded mission, item by item."""

import math
from typing import TYPE_CHECKING, Any

from dynamics.vector import ZERO, Vec3, norm, subtract
from services.autopilot.commander.guide import turn
from services.autopilot.commander.modes import land, return_, takeoff
from services.autopilot.commander.modes.base import FlightMode, value

if TYPE_CHECKING:
    from services.autopilot.commander.pilot import Pilot

NAME = "mission"
TURNED = 0.05  # [rad]
ARRIVED = 0.05  # [m]


class Mode(FlightMode):
    """Flies the route from its current item, or from the one given."""

    def __init__(self, pilot: "Pilot", *values: float):
        route = pilot.route
        if not route.items:
            raise ValueError("mission: there is none; upload one first")
        first = value(values, 0)
        if math.isfinite(first):
            route.select(int(first))
        elif route.item is None:
            route.restart()
        self._number: int | None = None
        self._since = 0.0  # [s] that the item's place has been reached
        self._inner: Any = None  # another mode that flies the item
        self._start = ZERO
        self._last: Vec3 | None = None  # place of the last waypoint [m]
        self.count = len(route.items)

    @property
    def phase(self) -> str:
        """Which item."""
        return "complete" if self._number is None else f"item {self._number + 1} of {self.count}"

    def step(self, pilot: "Pilot", dt: float) -> None:
        """Fly the current item, or go on with the next."""
        route = pilot.route
        if not pilot.armed:
            return
        item = route.item
        if item is None:
            self._number = None
            self._stay(pilot, dt)
            return
        if not pilot.flying and item.action not in ("takeoff", "land", "return"):
            self._rise(pilot, item)
        if route.current != self._number:
            self._begin(pilot, item)
        if self._fly(pilot, item, dt):
            self._number = None if route.current == len(route.items) - 1 else self._number
            route.advance()

    def _stay(self, pilot: "Pilot", dt: float) -> None:
        """The mission is over: hold where its last waypoint is, whose radius may have been wide."""
        if self._last is None or not pilot.flying or norm(subtract(self._last, pilot.guide.position)) < ARRIVED:
            self.next = "hold"
        else:
            pilot.guide.to(self._last, pilot.limits, dt)
            pilot.guide.turn_at(0.0, pilot.limits, dt)

    def _begin(self, pilot: "Pilot", item: Any) -> None:
        self._number, self._since, self._inner = pilot.route.current, 0.0, None
        self._start = pilot.guide.position
        if item.action == "takeoff":
            height = max(pilot.ground + 0.1, item.position.z) if math.isfinite(item.position.z) else math.nan
            if not (pilot.flying and pilot.guide.position[2] >= height):
                self._inner = takeoff.Mode(pilot, height, item.yaw)
        elif item.action == "return":
            self._inner = return_.Mode(pilot)

    @staticmethod
    def _rise(pilot: "Pilot", item: Any) -> None:
        """A mission without a take-off starts from the ground all the same."""
        if item.action in ("waypoint", "loiter_time"):
            pilot.lift_off()

    def _fly(self, pilot: "Pilot", item: Any, dt: float) -> bool:
        """Lead the guide for one tick; whether the item is done."""
        if item.action == "speed":
            pilot.speed = item.values[0]
            return True
        if self._inner is not None:
            self._inner.step(pilot, dt)
            if self._inner.next == "land":
                self._inner = land.Mode(pilot)
            return self._inner.next == "hold"
        if item.action == "takeoff":
            return True
        target = self._target(pilot, item)
        if item.action in ("waypoint", "loiter_time"):
            self._last = target
        guide, limits = pilot.guide, pilot.limits
        guide.to(target, limits, dt)
        guide.turn_to(item.yaw, limits, dt)
        radius = item.radius if item.radius > 0.0 else pilot.parameters["NAV_ACC_RAD"]
        if item.action == "land" or item.hold > 0.0:
            radius = min(radius, 0.2)  # to wait or land somewhere the vehicle must be there
        left = norm(subtract(target, guide.position))
        aligned = math.isnan(item.yaw) or abs(turn(item.yaw - guide.yaw)) < TURNED
        if self._since == 0.0 and not (left < radius and aligned):
            return False
        self._since += dt
        if item.action == "land":
            self._inner = land.Mode(pilot)
            return False
        return self._since >= item.hold

    def _target(self, pilot: "Pilot", item: Any) -> Any:
        asked = item.position if item.action in ("waypoint", "loiter_time", "land") else (math.nan,) * 3
        place = [h if math.isnan(p) else p for h, p in zip(self._start, asked, strict=True)]
        if item.action == "land":
            place[2] = self._start[2]  # across first, then down
        return tuple(place)
