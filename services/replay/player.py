"""Playback of a log on the bus, with the keys, payloads and time stamps of the live run."""

import time
from collections.abc import Callable, Collection, Iterable
from functools import partial
from pathlib import Path

from lapwing.cosim.log import LogReader, LogWriter
from lapwing.cosim.transport.bus import ZenohBus
from lapwing.cosim.transport.bus_keys import ALIVE_KEY, HEARD_KEY
from lapwing.services.replay.playback_timing import Cut, Pace, schedule

SUBSCRIBER_TIMEOUT = 1.0  # [s] for the first subscriber to appear
CONFIRMATION_TIMEOUT = 60.0  # [s] for subscribers to confirm the end
CHECK_INTERVAL = 0.02  # [s] between two checks


def play(
    log: Path,
    key_prefix: str,
    listen: str,
    cut: Cut,
    speed: float | None,
    loop: bool,
    record: Path | None,
    stopping: Callable[[], bool],
    listener: Callable[[str, int, bytes], object] = lambda topic, time_ns, payload: None,
    pace: Pace | None = None,
    topics: Collection[str] | None = None,
) -> int:
    """Publish a log. Return the number of published messages.

    Args:
        log: MCAP log.
        key_prefix: key prefix to publish in.
        listen: endpoint that subscribers connect to.
        cut: part of the log to play.
        speed: simulated seconds per second; None for as fast as possible.
        loop: True to restart at the end.
        record: log to write the published messages to.
        stopping: returns True to stop.
        listener: called with each message, for consumers that do not subscribe.
        pace: clock that releases messages; real time by default.
        topics: topics to play; None for all.

    Raises:
        ValueError: the log cannot be read, has no such topic, or has no message in this part.
        BusError: the bus cannot listen at the endpoint.
    """
    with LogReader(log) as source, ZenohBus([listen]) as bus:
        selected = source.check_topics(topics)
        source.check_versions(selected)
        types = {topic: kind for topic, kind in source.topics().items() if topic in selected}
        deterministic = source.deterministic_topics()
        publishers = {topic: bus.publisher(f"{key_prefix}{topic}") for topic in types}
        subscribers = Subscribers(bus, key_prefix)
        _await_subscriber(bus, [f"{key_prefix}{topic}" for topic in types], stopping)
        writer = LogWriter(record, _copy_metadata(source.metadata), dict(source.attachments)) if record else None
        count, pace = 0, pace or Pace()
        try:
            while not (stopping() or pace.quit):
                pace.begin()
                for due in schedule(source.messages(selected, cut.start_ns, cut.end_ns), speed):
                    pace.wait(due.wait, due.time_ns, stopping)
                    if stopping() or pace.quit:
                        break
                    publishers[due.topic](due.payload, due.time_ns)
                    listener(due.topic, due.time_ns, due.payload)
                    count += 1
                    if writer:
                        writer.write(due.topic, types[due.topic], due.payload, due.time_ns, due.topic in deterministic)
                if count == 0 and not (stopping() or pace.quit):
                    raise ValueError(f"{log}: no message between --from and --to")
                if not loop or writer:
                    subscribers.await_confirmation(publishers.values(), stopping)
                    break
        finally:
            if writer:
                writer.close()
    return count


class Subscribers:
    """Programs that have declared their presence, and those that have confirmed the end of the playback."""

    def __init__(self, bus: ZenohBus, key_prefix: str):
        """Watch the liveliness tokens of a key prefix."""
        self._alive: set[str] = set()
        self._confirmed: set[str] = set()
        bus.watch_liveliness(f"{key_prefix}/{ALIVE_KEY}/*", partial(self._change, self._alive))
        bus.watch_liveliness(f"{key_prefix}/{HEARD_KEY}/*", partial(self._change, self._confirmed))

    @staticmethod
    def _change(names: set[str], key: str, alive: bool) -> None:
        name = key.rpartition("/")[2]
        if alive:
            names.add(name)
        else:
            names.discard(name)

    def await_confirmation(
        self, publishers: Iterable[Callable[[bytes, int], None]], stopping: Callable[[], bool]
    ) -> None:
        """Publish the end of each topic, and wait for confirmations, without which a closing session loses messages.

        Raises:
            ValueError: a program has not confirmed in time.
        """
        for publish in publishers:
            publish(b"", 0)
        deadline = time.monotonic() + CONFIRMATION_TIMEOUT
        while (unconfirmed := self._alive - self._confirmed) and not stopping():
            if time.monotonic() > deadline:
                raise ValueError(
                    f"{', '.join(sorted(unconfirmed))}: did not confirm the last message in {CONFIRMATION_TIMEOUT:g} s"
                )
            time.sleep(CHECK_INTERVAL)


def _copy_metadata(metadata: dict[str, str]) -> dict[str, str]:
    """Return the log's metadata without the recomputed entries."""
    return {key: value for key, value in metadata.items() if key != "digest"}


def _await_subscriber(bus: ZenohBus, keys: list[str], stopping: Callable[[], bool]) -> None:
    deadline = time.monotonic() + SUBSCRIBER_TIMEOUT
    while time.monotonic() < deadline and not stopping() and not bus.has_subscribers(keys):
        time.sleep(CHECK_INTERVAL)
