"""Puts what arrives in any order into the log's order: tick by tick, within a tick in the order of the topic table."""

import math
from collections.abc import Iterator

from messages.topics import TOPICS, Topic
from services.scene import Scene
from services.sections import period


class Collator:
    """Holds messages back until their tick is complete, so that a log has no half ticks and one order only."""

    def __init__(self, scene: Scene, published: set[Topic]):
        """`published`: the topics that somebody of this run publishes in lock step."""
        self.topics = [topic for topic in TOPICS if topic.recorded and topic in published]
        periods = [period(scene, topic) for topic in self.topics]
        self._cycle = math.lcm(*periods) if periods else 1
        self._due = [sum(tick % every == 0 for every in periods) for tick in range(self._cycle)]
        self._index = {topic: i for i, topic in enumerate(self.topics)}
        self._pending: dict[int, list[tuple[int, bytes]]] = {}
        self._next: int | None = None

    def add(self, topic: Topic, tick: int, payload: bytes) -> None:
        """A message of `topic` stamped with `tick`; topics that are not recorded are passed over."""
        index = self._index.get(topic)
        if index is None:
            return
        if self._next is None:
            self._next = tick
        self._next = min(self._next, tick)
        self._pending.setdefault(tick, []).append((index, payload))

    def complete(self) -> Iterator[tuple[int, list[tuple[Topic, bytes]]]]:
        """The ticks that are complete now, in order: (tick, [(topic, payload)])."""
        while self._next is not None:
            due = self._due[self._next % self._cycle]
            held = self._pending.get(self._next, ())
            if due and len(held) < due:
                return
            if not due and not self._pending:
                return
            if due:
                messages = sorted(self._pending.pop(self._next))
                yield self._next, [(self.topics[index], payload) for index, payload in messages]
            self._next += 1

    def waits_for(self) -> str:
        """The topics that the next tick still lacks."""
        if self._next is None:
            return "the first message"
        there = {index for index, _ in self._pending.get(self._next, ())}
        return ", ".join(t.name for i, t in enumerate(self.topics) if i not in there) + f" of tick {self._next}"
