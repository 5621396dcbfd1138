"""Plays a log on the bus: the same keys, payloads and time stamps as the live run."""

import time
from collections.abc import Callable, Collection
from pathlib import Path

from lapwing.cosim.log import LogReader, LogWriter
from lapwing.cosim.transport.bus import ZenohBus
from lapwing.services.replay.playback_clock import Pace
from lapwing.services.replay.playback_schedule import Cut, schedule

AUDIENCE = 1.0  # [s] the first subscriber gets to appear


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
        heard: called with each message, for those who are no subscribers.
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
                    break
        finally:
            if writer:
                writer.close()
    return count


def _own(metadata: dict[str, str]) -> dict[str, str]:
    """The log's metadata, but for what is computed anew."""
    return {key: value for key, value in metadata.items() if key != "digest"}


def _await_audience(bus: ZenohBus, keys: list[str], stopping: Callable[[], bool]) -> None:
    deadline = time.monotonic() + AUDIENCE
    while time.monotonic() < deadline and not stopping() and not bus.has_audience(keys):
        time.sleep(0.02)
