"""Mission items and the current one."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

NONE_REACHED = 65535
NO_MISSION, NOT_STARTED, ACTIVE, PAUSED, COMPLETE = 1, 2, 3, 4, 5  # values of Status.mission_state

TO_PLACES = ("waypoint", "loiter_time", "loiter", "loiter_to_alt")  # actions with a position
INSTANT = ("speed", "roi", "set_home", "gripper")  # actions that take no time
GRAB = 1.0  # value of the action gripper; 0: release
ACTIONS = (*TO_PLACES, *INSTANT, "takeoff", "land", "return", "delay", "condition", "jump", "yaw")

MAXIMUM_TAKEOFF_HEIGHT = 1000.0  # [m]


def check_items(items: Sequence[Any]) -> None:
    """Raise ValueError (one line) for the first invalid item."""
    for number, item in enumerate(items):
        if item.action not in ACTIONS:
            raise ValueError(f"item {number}: unknown action {item.action}; expected one of {', '.join(ACTIONS)}")
        if item.action == "waypoint" and not all(map(math.isfinite, item.position)):
            raise ValueError(f"item {number}: {item.action} needs a position")
        if item.action == "takeoff" and MAXIMUM_TAKEOFF_HEIGHT < item.position.z < math.inf:
            raise ValueError(f"item {number}: expected a take-off to at most {MAXIMUM_TAKEOFF_HEIGHT:g} m")
        if math.isinf(item.yaw) or not (math.isfinite(item.hold_time) and item.hold_time >= 0.0):
            raise ValueError(f"item {number}: expected a finite yaw, and a time of 0 s or more")
        if item.action == "jump" and not (len(item.values) > 1 and 0 <= item.values[0] < len(items)):
            raise ValueError(
                f"item {number}: expected a jump to an item from 0 to {len(items) - 1}, and a number of repetitions"
            )
        if item.action == "speed" and not (item.values and (item.values[0] > 0.0 or math.isnan(item.values[0]))):
            raise ValueError(f"item {number}: expected a speed above 0 m/s, or NaN for that of the parameters")


class Route:
    """Items, current item and counters of jumps."""

    def __init__(self, items: Sequence[Any] = ()):
        """Start at the first item. Raise ValueError if an item is invalid."""
        check_items(items)
        self.items = tuple(items)
        self.current, self.reached = 0, NONE_REACHED
        self._jumped: dict[int, int] = {}

    @property
    def item(self) -> Any:
        """Current item, None after the last."""
        return self.items[self.current] if self.current < len(self.items) else None

    @property
    def on_last(self) -> bool:
        """True if the current item is the last."""
        return self.current == len(self.items) - 1

    def select(self, number: int) -> None:
        """Select the current item. Raise ValueError if it does not exist."""
        if not 0 <= number < len(self.items):
            raise ValueError(f"no item {number}; the mission has {len(self.items)}")
        self.current = number
        self._jumped.clear()

    def advance(self) -> None:
        """Mark the current item as done and go to the next one, following jumps."""
        self.reached = self.current
        self.current += 1
        for _ in self.items:  # limits consecutive jumps, which may form a loop
            item = self.item
            if item is None or item.action != "jump":
                return
            jumps = self._jumped.get(self.current, 0)
            if jumps < item.values[1]:
                self._jumped[self.current] = jumps + 1
                self.current = int(item.values[0])
            else:
                self.current += 1

    def following(self) -> Iterator[Any]:
        """Yield the items after the current one in order of flight, without jumps."""
        number, jumped = self.current + 1, dict(self._jumped)
        while number < len(self.items):
            item = self.items[number]
            jumps = jumped.get(number, 0)
            if item.action != "jump":
                yield item
                number += 1
            elif jumps < item.values[1]:
                jumped[number] = jumps + 1
                number = int(item.values[0])
            else:
                number += 1

    def restart(self) -> None:
        """Select the first item."""
        self.current, self.reached = 0, NONE_REACHED
        self._jumped.clear()
