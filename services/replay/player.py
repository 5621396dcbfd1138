"""Plays a log on the bus: the same keys, payloads and time stamps as the live run."""

import time
from collections.abc import Callable, Collection, Iterable
from functools import partial
from pathlib import Path

from lapwing.cosim.log import LogReader, LogWriter
from lapwing.cosim.transport.bus import ZenohBus
from lapwing.cosim.transport.bus_keys import ALIVE_KEY, HEARD_KEY
from lapwing.services.replay.playback_clock import Pace
from lapwing.services.replay.playback_schedule import Cut, schedule

AUDIENCE = 1.0  # [s] the first subscriber gets to appear
CONFIRMATION = 60.0  # [s] subscribers get to confirm the end
BRIEF = 0.02  # [s]


def play(
    log: Path,
    key_prefix: str,
    listen: str,
    cut: Cut,
    speed: float | None,
    loop: bool,
    record: Path | None,
    stopping: Callable[[], bool],
    heard: Callable[[str, int, bytes], object] = lambda topic, time_ns, payload: None,
    pace: Pace | None = None,
    topics: Collection[str] | None = None,
) -> int:
    """Publish a log; how many messages were published.

    Args:
        log: the MCAP log.
        key_prefix: key prefix to publish in.
        listen: endpoint that subscribers connect to.
        cut: the part to replay.
        speed: simulated seconds per second, None for as fast as it goes.
        loop: begin again at the end.
        record: a log to write what is published to, None for none.
        stopping: says whether to end.
        heard: called with each message, for consumers that do not subscribe.
        pace: lets messages go; None: by the clock.
        topics: only these; None: all.

    Raises:
        ValueError: the log cannot be read, has no such topic, or has no message in the cut.
        BusError: the endpoint cannot be listened on.
    """
    with LogReader(log) as source, ZenohBus([listen]) as bus:
        chosen = source.check_topics(topics)
        source.check_versions(chosen)
        types = {topic: kind for topic, kind in source.topics().items() if topic in chosen}
        deterministic = source.deterministic_topics()
        puts = {topic: bus.publisher(f"{key_prefix}{topic}") for topic in types}
        subscribers = Subscribers(bus, key_prefix)
        _await_audience(bus, [f"{key_prefix}{topic}" for topic in types], stopping)
        writer = LogWriter(record, _own(source.metadata), dict(source.attachments)) if record else None
        count, pace = 0, pace or Pace()
        try:
            while not (stopping() or pace.quit):
                pace.begin()
                for due in schedule(source.messages(chosen, cut.start_ns, cut.end_ns), speed):
                    pace.wait(due.wait, due.time_ns, stopping)
                    if stopping() or pace.quit:
                        break
                    puts[due.topic](due.payload, due.time_ns)
                    heard(due.topic, due.time_ns, due.payload)
                    count += 1
                    if writer:
                        writer.write(due.topic, types[due.topic], due.payload, due.time_ns, due.topic in deterministic)
                if count == 0 and not (stopping() or pace.quit):
                    raise ValueError(f"{log}: no message in the part that is to be replayed")
                if not loop or writer:
                    subscribers.await_confirmation(puts.values(), stopping)
                    break
        finally:
            if writer:
                writer.close()
    return count


class Subscribers:
    """Programs that have declared that they take part, and those that have confirmed the end of the playback."""

    def __init__(self, bus: ZenohBus, key_prefix: str):
        """Follow the tokens of a key prefix."""
        self._alive: set[str] = set()
        self._confirmed: set[str] = set()
        bus.watch_alive(f"{key_prefix}/{ALIVE_KEY}/*", partial(self._change, self._alive))
        bus.watch_alive(f"{key_prefix}/{HEARD_KEY}/*", partial(self._change, self._confirmed))

    @staticmethod
    def _change(names: set[str], key: str, alive: bool) -> None:
        name = key.rpartition("/")[2]
        if alive:
            names.add(name)
        else:
            names.discard(name)

    def await_confirmation(self, puts: Iterable[Callable[[bytes, int], None]], stopping: Callable[[], bool]) -> None:
        """Publish the end of each topic, and wait for confirmations, without which a closing session loses messages.

        Raises:
            ValueError: names those that have not confirmed in time.
        """
        for put in puts:
            put(b"", 0)
        deadline = time.monotonic() + CONFIRMATION
        while (late := self._alive - self._confirmed) and not stopping():
            if time.monotonic() > deadline:
                raise ValueError(f"{', '.join(sorted(late))}: did not confirm the last message in {CONFIRMATION:g} s")
            time.sleep(BRIEF)


def _own(metadata: dict[str, str]) -> dict[str, str]:
    """Return the log's metadata without the recomputed entries."""
    return {key: value for key, value in metadata.items() if key != "digest"}


def _await_audience(bus: ZenohBus, keys: list[str], stopping: Callable[[], bool]) -> None:
    deadline = time.monotonic() + AUDIENCE
    while time.monotonic() < deadline and not stopping() and not bus.has_audience(keys):
        time.sleep(BRIEF)
