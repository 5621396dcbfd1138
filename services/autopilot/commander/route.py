"""Mission items and the current one."""

from collections.abc import Iterator, Sequence
from typing import Any

from lapwing.services.common.plans.route_checks import check_items

NONE_REACHED = 65535
NO_MISSION, NOT_STARTED, ACTIVE, PAUSED, COMPLETE = 1, 2, 3, 4, 5  # values of Status.mission_state

GRAB = 1.0  # value of the action gripper; 0: release


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

    def following(self, most: int) -> Iterator[Any]:
        """Yield up to `most` items after the current one in order of flight, without jumps."""
        number, jumped = self.current + 1, dict(self._jumped)
        for _ in range(most * (1 + len(self.items))):  # between two items are fewer jumps than items
            if most == 0 or number >= len(self.items):
                return
            item = self.items[number]
            jumps = jumped.get(number, 0)
            if item.action != "jump":
                yield item
                number, most = number + 1, most - 1
            elif jumps < item.values[1]:
                jumped[number] = jumps + 1
                number = int(item.values[0])
            else:
                number += 1

    def restart(self) -> None:
        """Select the first item."""
        self.current, self.reached = 0, NONE_REACHED
        self._jumped.clear()
