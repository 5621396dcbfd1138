"""Order of the messages of a log: by tick, and within a tick in the order of the topic table."""

import time
from collections.abc import Iterable

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.topic_encoder import RecordBatch, split_at
from lapwing.cosim.log import LogWriter
from lapwing.messages import WallTime, header
from lapwing.messages.topics import TOPICS, WALL_TIME, Topic, topic_rank

CHUNK = 1000  # [ticks] of one vehicle; fewer with several vehicles, so that a chunk stays in the processor's cache
SHORTEST = 250  # ticks
FLUSH_PERIOD = 0.25  # [s] of wall time between two writes of an incomplete chunk; log packets take 0.1 s more
FLUSH_RATIO = 10.0  # smallest ratio of this period to the time of such a write, which repeats the chunk's beginning


def chunk(setup: RunConfig) -> int:
    """Return the ticks of a chunk. Chunks begin at multiples of it, so the file does not depend on packet timing."""
    return max(SHORTEST, CHUNK // len(setup.vehicles))


class Recording:
    """Writes record batches, and the wall time with every chunk. Call `finish` after the last batch."""

    def __init__(self, writer: LogWriter, setup: RunConfig):
        """Record the messages of the run `setup` with `writer`."""
        self._writer, self._setup = writer, setup
        self._started = time.monotonic()
        self._flushed = self._started
        self._tail_took = 0.0  # [s] of this thread for the newest tail
        self._waiting: list[RecordBatch] = []  # batches of the incomplete chunk
        self._chunk = chunk(setup)
        self._cut = self._chunk  # tick at which the chunk ends
        self.newest: dict[Topic, bytes] = {}
        self.time_ns = 0
        self._write_wall_time(0)

    def write(self, pages: Iterable[RecordBatch], last: int) -> None:
        """Write all messages of some ticks, up to the tick `last`."""
        for page in pages:
            self._waiting.append(page)
            self.newest[page.topic] = page.payloads[-1].tobytes()
        self.time_ns = max(last, 0) * self._setup.interval_ns
        while last + 1 >= self._cut:
            self._write_chunk()
        now = time.monotonic()
        if now - self._flushed >= max(FLUSH_PERIOD, FLUSH_RATIO * (self._tail_took + self._writer.tail_took)):
            self._writer.write_tail(self._parts(self._waiting))
            self._flushed = time.monotonic()
            self._tail_took = self._flushed - now

    def finish(self) -> None:
        """Write the last chunk."""
        self._write_chunk()

    def _write_chunk(self) -> None:
        """Write the messages of the ticks before the cut, and the wall time."""
        complete, self._waiting = split_at(self._waiting, self._cut)
        if complete:
            self._writer.write_page(self._parts(complete))
            self._flushed = time.monotonic()
        self._write_wall_time(min(self.time_ns, (self._cut - 1) * self._setup.interval_ns))
        self._cut += self._chunk

    def _parts(self, pages: list[RecordBatch]) -> list[tuple]:
        interval, vehicles = self._setup.interval_ns, self._setup.vehicles
        parts = []
        for page in sorted(pages, key=lambda page: topic_rank(page.topic)):  # independent of the order of arrival
            vehicle = vehicles.index(page.topic.vehicle) if page.topic.vehicle else 0
            order = (page.ticks * (len(TOPICS) + 1) + topic_rank(page.topic)) * len(vehicles) + vehicle
            name = page.topic.key(self._setup.vehicle)
            parts.append((name, page.topic.message, page.ticks * interval, page.payloads, order))
        return parts

    def _write_wall_time(self, time_ns: int) -> None:
        elapsed = time.monotonic() - self._started
        factor = time_ns * 1e-9 / elapsed if elapsed > 0.0 else 0.0
        message = WallTime(header(time_ns, ""), time.time(), factor)
        self._writer.write(WALL_TIME.key(), WallTime, message.encode(), time_ns, deterministic=False)
