"""What a service publishes: each message at once to those who need it, and bundled to the recorder.

A recorder that subscribes to every topic would wake up for each message and halve the rate of the lock step
(docs/benchmarks.md). Instead every service keeps a journal of what it has published and hands it over now and then.
"""

import struct
import time
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from messages.topics import TOPICS, Topic
from services.sections import Exchange

if TYPE_CHECKING:
    from services.process import Process

JOURNAL_KEY = "_journal"
PAGE = 32 * 1024  # [bytes] a journal is handed over when it is this long
AGE = 0.1  # [s] of wall time, or this old

_ENTRY = struct.Struct("<HqI")  # index in the topic table, tick, length of the payload that follows


def entries(page: bytes) -> Iterator[tuple[Topic, int, bytes]]:
    """The messages of a journal page: (topic, tick, payload)."""
    offset = 0
    while offset < len(page):
        index, tick, length = _ENTRY.unpack_from(page, offset)
        offset += _ENTRY.size
        yield TOPICS[index], tick, page[offset : offset + length]
        offset += length


class Outlets:
    """The outputs of one service."""

    def __init__(self, process: "Process", topics: Iterable[Topic]):
        """Declare the publishers of `topics`, and of the journal."""
        self._interval = process.scene[Exchange].interval_ns
        self._puts = {topic: process.bus.publisher(process.key(topic)) for topic in topics}
        self._index = {topic: TOPICS.index(topic) for topic in self._puts if topic.recorded}
        self._hand_over = process.bus.publisher(f"{process.space}/{JOURNAL_KEY}/{process.name}")
        self._page: list[bytes] = []
        self._length = 0
        self._due = 0.0

    def publish(self, tick: int, messages: Iterable[tuple[Topic, Any]]) -> None:
        """Publish the messages of a tick."""
        time_ns = tick * self._interval
        for topic, message in messages:
            payload = message.encode()
            self._puts[topic](payload, time_ns)
            index = self._index.get(topic)
            if index is not None:
                self._page += (_ENTRY.pack(index, tick, len(payload)), payload)
                self._length += len(payload)
        if self._length > PAGE or time.monotonic() > self._due:
            self._flush(time_ns)

    def _flush(self, time_ns: int) -> None:
        if self._page:
            self._hand_over(b"".join(self._page), time_ns)
        self._page, self._length, self._due = [], 0, time.monotonic() + AGE

    def end(self, tick: int) -> None:
        """Hand over the rest and say, by empty messages, that there will be no more."""
        self._flush(tick * self._interval)
        for put in [self._hand_over, *self._puts.values()]:
            put(b"", tick * self._interval)
