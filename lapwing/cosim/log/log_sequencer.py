"""Order of the messages of a log: by tick, and within a tick in the order of the topic table."""

import time
from collections.abc import Iterable

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.topic_encoder import RecordBatch, split_at
from lapwing.cosim.log import LogWriter
from lapwing.messages import WallTime, header
from lapwing.messages.topics import TOPICS, WALL_TIME, Topic, topic_rank

CHUNK = 1000  # [ticks] limit for one vehicle; less with several vehicles: a chunk stays in the processor's cache
SHORTEST = 250  # [ticks] smallest limit
FLUSH_PERIOD = 0.25  # [s] of wall time after which a chunk is written earlier; log packets take 0.1 s more


def chunk(config: RunConfig) -> int:
    """Return the largest number of ticks in a chunk."""
    return max(SHORTEST, CHUNK // len(config.vehicles))


class Recording:
    """Writes record batches, and the wall time with every chunk. Call `finish` after the last batch."""

    def __init__(self, writer: LogWriter, config: RunConfig):
        """Record the messages of the run `config` with `writer`."""
        self._writer, self._config = writer, config
        self._started = self._flushed = time.monotonic()
        self._waiting: list[RecordBatch] = []  # batches of the incomplete chunk
        self._chunk = chunk(config)
        self._cut = self._chunk  # tick at which the chunk ends at the latest
        self.newest: dict[Topic, bytes] = {}
        self.time_ns = 0
        self._write_wall_time(0)

    def write(self, batches: Iterable[RecordBatch], last: int) -> None:
        """Write all messages of some ticks, up to the tick `last`."""
        for batch in batches:
            self._waiting.append(batch)
            self.newest[batch.topic] = batch.payloads[-1].tobytes()
        self.time_ns = max(last, 0) * self._config.interval_ns
        while last + 1 >= self._cut:
            self._write_chunk(self._cut)
        if self._waiting and time.monotonic() - self._flushed >= FLUSH_PERIOD:
            self._write_chunk(last + 1)

    def finish(self) -> None:
        """Write the last chunk."""
        self._write_chunk(self._cut)

    def _write_chunk(self, stop: int) -> None:
        """Write the messages of the ticks before `stop`, and the wall time."""
        complete, self._waiting = split_at(self._waiting, stop)
        if complete:
            self._writer.write_batch(self._parts(complete))
            self._flushed = time.monotonic()
        self._write_wall_time(min(self.time_ns, (stop - 1) * self._config.interval_ns))
        self._cut = stop + self._chunk

    def _parts(self, batches: list[RecordBatch]) -> list[tuple]:
        interval, vehicles = self._config.interval_ns, self._config.vehicles
        parts = []
        for batch in sorted(batches, key=lambda batch: topic_rank(batch.topic)):  # independent of the order of arrival
            vehicle = vehicles.index(batch.topic.vehicle) if batch.topic.vehicle else 0
            order = (batch.ticks * (len(TOPICS) + 1) + topic_rank(batch.topic)) * len(vehicles) + vehicle
            name = batch.topic.key(self._config.vehicle)
            parts.append((name, batch.topic.message, batch.ticks * interval, batch.payloads, order))
        return parts

    def _write_wall_time(self, time_ns: int) -> None:
        elapsed = time.monotonic() - self._started
        factor = time_ns * 1e-9 / elapsed if elapsed > 0.0 else 0.0
        message = WallTime(header(time_ns, ""), time.time(), factor)
        self._writer.write(WALL_TIME.key(), WallTime, message.encode(), time_ns, deterministic=False)
