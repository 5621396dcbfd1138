"""Pages of messages into a log, in one order: by tick, within a tick in the order of the topic table."""

import time
from collections.abc import Iterable

from cosim.log import LogWriter
from cosim.setup import Setup
from cosim.wire import Page
from messages import WallTime, header
from messages.topics import TOPICS, WALL_TIME, Topic, place

WALL_PERIOD = 0.5  # [s] between two messages of wall time


class Recording:
    """Writes pages, and now and then the wall time."""

    def __init__(self, writer: LogWriter, setup: Setup):
        """Into `writer`, the messages of the run `setup`."""
        self._writer, self._setup = writer, setup
        self._started = time.monotonic()
        self._next_wall = 0.0
        self.newest: dict[Topic, bytes] = {}
        self.time_ns = 0

    def write(self, pages: Iterable[Page], last: int) -> None:
        """Write all messages of some ticks, up to the tick `last`."""
        interval = self._setup.interval_ns
        parts = []
        for page in pages:
            order = page.ticks * (len(TOPICS) + 1) + place(page.topic)
            name = page.topic.key(self._setup.vehicle)
            parts.append((name, page.topic.message, page.ticks * interval, page.payloads, order))
            self.newest[page.topic] = page.payloads[-1].tobytes()
        self.time_ns = last * interval
        if parts:
            self._writer.write_page(parts)
        now = time.monotonic()
        if now >= self._next_wall:
            self._next_wall = now + WALL_PERIOD
            elapsed = now - self._started
            factor = self.time_ns * 1e-9 / elapsed if elapsed > 0.0 else 0.0
            message = WallTime(header(max(self.time_ns, 0), ""), time.time(), factor)
            name = WALL_TIME.key()
            self._writer.write(name, WallTime, message.encode(), max(self.time_ns, 0), deterministic=False)
