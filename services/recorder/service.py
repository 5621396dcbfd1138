"""The recorder process: every declared topic into one MCAP log, complete to the last tick."""

import time
from pathlib import Path
from typing import Any, Protocol

from messages import WallTime, header
from messages.topics import WALL_TIME, Topic
from services.journal import JOURNAL_KEY, entries
from services.lockstep import published
from services.log import LogWriter
from services.process import Process, Stopped
from services.provenance import attachments, metadata
from services.recorder.collate import Collator
from services.sections import Exchange, Vehicle
from services.table import lockstep_services

WALL_PERIOD = 0.5  # [s] between two messages of wall time


def run(process: Process, log: Path) -> None:
    """Record until every service has said that it has ended, or until asked to stop; the log is readable either way."""
    scene = process.scene
    interval, vehicle = scene[Exchange].interval_ns, scene[Vehicle].name
    flying = lockstep_services(scene)
    collator = Collator(scene, published(flying.values()))
    journals = process.bus.subscribe(f"{process.space}/{JOURNAL_KEY}/*")
    ended = 0
    with LogWriter(log, metadata(scene, "processes"), attachments(scene)) as writer:
        writing = Writing(writer, collator, vehicle, interval)
        try:
            process.join()
            while ended < len(flying):
                _, page = process.patient(journals.get, collator.waits_for)
                ended += not page
                for topic, tick, payload in entries(page):
                    collator.add(topic, tick, payload)
                writing.write_complete()
        except Stopped:
            pass


class Sink(Protocol):
    """What takes the messages of a run: a log, or a study that looks at them."""

    def write(self, topic: str, message: Any, payload: bytes, time_ns: int, deterministic: bool = True) -> None:
        """Take one message, as `LogWriter.write` does."""
        ...


class Writing:
    """Writes complete ticks into a log, and now and then the wall time."""

    def __init__(self, writer: Sink, collator: Collator, vehicle: str, interval: int):
        """Ticks of `interval` [ns], topics of `vehicle`."""
        self._writer, self._collator, self._interval = writer, collator, interval
        self._names = {topic: topic.key(vehicle) for topic in collator.topics}
        self._started: float | None = None
        self._next_wall = 0.0
        self.newest: dict[Topic, bytes] = {}
        self.time_ns = 0

    def write_complete(self) -> None:
        """Write the ticks that have become complete."""
        for tick, messages in self._collator.complete():
            self.time_ns = tick * self._interval
            for topic, payload in messages:
                self._writer.write(self._names[topic], topic.message, payload, self.time_ns)
                self.newest[topic] = payload
        now = time.monotonic()
        if now >= self._next_wall:
            self._started = self._started or now
            self._next_wall = now + WALL_PERIOD
            self._write_wall_time(now - self._started)

    def _write_wall_time(self, elapsed: float) -> None:
        factor = self.time_ns * 1e-9 / elapsed if elapsed > 0.0 else 0.0
        message = WallTime(header(self.time_ns, ""), time.time(), factor)
        self._writer.write(WALL_TIME.key(), WallTime, message.encode(), self.time_ns, deterministic=False)
