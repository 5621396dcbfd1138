"""The uploaded mission, item by item."""

import math
from typing import Any

from dynamics.vector import ZERO, Vec3, norm, subtract
from services.autopilot.commander.flight_mode import FlightMode, fill_in, value
from services.autopilot.commander.guidance import Guidance
from services.autopilot.commander.modes import land, return_, takeoff
from services.autopilot.commander.smoothing import wrap_angle
from services.autopilot.commander.view import Constants, View

NAME = "mission"
YAW_TOLERANCE = 0.05  # [rad]
ARRIVED = 0.05  # [m]
EXACT_RADIUS = 0.2  # [m] to wait or land somewhere the vehicle must be there
_NOT_GIVEN = (math.nan, math.nan, math.nan)


class Mode(FlightMode):
    """Flies the route from its current item, or from the one given."""

    def __init__(self, constants: Constants, guidance: Guidance, *values: float):
        route = guidance.route
        if not route.items:
            raise ValueError("mission: there is none; upload one first")
        first = value(values, 0)
        if math.isfinite(first):
            route.select(int(first))
        elif route.item is None:
            route.restart()
        self._number: int | None = None
        self._time_there = 0.0  # [s] since the item's place was reached
        self._item_mode: FlightMode | None = None  # another mode that flies the item
        self._start = ZERO  # where the item was begun [m]
        self._last_waypoint: Vec3 | None = None  # [m]
        self._count = len(route.items)

    @property
    def phase(self) -> str:
        """Which item."""
        return "complete" if self._number is None else f"item {self._number + 1} of {self._count}"

    def step(self, constants: Constants, view: View, guidance: Guidance) -> None:
        """Fly the current item, or go on with the next."""
        route = guidance.route
        if not guidance.armed:
            return
        item = route.item
        if item is None:
            self._number = None
            self._stay(view, guidance)
            return
        if not guidance.flying and item.action in ("waypoint", "loiter_time"):
            guidance.lift_off(constants, view)  # a mission without a take-off starts from the ground all the same
        if route.current != self._number:
            self._begin(constants, guidance, item)
        if self._fly(constants, view, guidance, item):
            self._number = None if route.current == len(route.items) - 1 else self._number
            route.advance()

    def _stay(self, view: View, guidance: Guidance) -> None:
        """The mission is over: hold where its last waypoint is, whose radius may have been wide."""
        smoothing, last = guidance.smoothing, self._last_waypoint
        if last is None or not guidance.flying or norm(subtract(last, smoothing.position)) < ARRIVED:
            self.next_mode = "hold"
        else:
            smoothing.move_to(last, guidance.limits, view.dt)
            smoothing.turn_at(0.0, guidance.limits, view.dt)

    def _begin(self, constants: Constants, guidance: Guidance, item: Any) -> None:
        self._number, self._time_there, self._item_mode = guidance.route.current, 0.0, None
        self._start = guidance.smoothing.position
        if item.action == "takeoff":
            asked = item.position.z if math.isfinite(item.position.z) else guidance.parameters["MIS_TAKEOFF_ALT"]
            height = max(constants.resting_height + 0.1, asked)
            if not (guidance.flying and guidance.smoothing.position[2] >= height):
                self._item_mode = takeoff.Mode(constants, guidance, height, item.yaw)
        elif item.action == "return":
            self._item_mode = return_.Mode(constants, guidance)

    def _fly(self, constants: Constants, view: View, guidance: Guidance, item: Any) -> bool:
        """Move the setpoint for one tick; whether the item is done."""
        if item.action == "speed":
            guidance.speed = item.values[0]
            return True
        if self._item_mode is not None:
            self._item_mode.step(constants, view, guidance)
            if self._item_mode.next_mode == "land":
                self._item_mode = land.Mode(constants, guidance)
            return self._item_mode.next_mode == "hold"
        if item.action == "takeoff":
            return True
        reached = self._approach(view, guidance, item)
        if self._time_there == 0.0 and not reached:
            return False
        self._time_there += view.dt
        if item.action == "land":
            self._item_mode = land.Mode(constants, guidance)
            return False
        return self._time_there >= item.hold

    def _approach(self, view: View, guidance: Guidance, item: Any) -> bool:
        """Move towards the item's place and yaw; whether they are reached."""
        smoothing, limits = guidance.smoothing, guidance.limits
        target = self._target(item)
        if item.action in ("waypoint", "loiter_time"):
            self._last_waypoint = target
        smoothing.move_to(target, limits, view.dt)
        smoothing.turn_to(item.yaw, limits, view.dt)
        radius = item.radius if item.radius > 0.0 else guidance.parameters["NAV_ACC_RAD"]
        if item.action == "land" or item.hold > 0.0:
            radius = min(radius, EXACT_RADIUS)
        aligned = math.isnan(item.yaw) or abs(wrap_angle(item.yaw - smoothing.yaw)) < YAW_TOLERANCE
        return norm(subtract(target, smoothing.position)) < radius and aligned

    def _target(self, item: Any) -> Vec3:
        asked = tuple(item.position) if item.action in ("waypoint", "loiter_time", "land") else _NOT_GIVEN
        x, y, z = fill_in(self._start, asked)
        return x, y, self._start[2] if item.action == "land" else z  # to land: horizontally first, then down
