"""Plays a log on the bus: the same keys, payloads and time stamps as the live run."""

import time
from collections.abc import Callable
from pathlib import Path

from cosim.bus import ZenohBus
from cosim.log import LogReader, LogWriter
from services.replay.schedule import Cut, schedule

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
    heard: Callable[[str, int, bytes], None] = lambda topic, time_ns, payload: None,
    wait: Callable[[float], None] = time.sleep,
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
        wait: waits so many seconds, or less.

    Raises:
        ValueError: the log cannot be read, or has no message in the cut.
        BusError: the endpoint cannot be listened on.
    """
    with LogReader(log) as source, ZenohBus([listen]) as bus:
        types, deterministic = source.topics(), source.deterministic_topics()
        puts = {topic: bus.publisher(f"{key_prefix}{topic}") for topic in types}
        _await_audience(bus, [f"{key_prefix}{topic}" for topic in types], stopping)
        writer = LogWriter(record, _own(source.metadata), dict(source.attachments)) if record else None
        count = 0
        try:
            while not stopping():
                started = time.perf_counter()
                for due in schedule(source.messages(None, cut.start_ns, cut.end_ns), speed):
                    _wait(started + due.wait, stopping, wait)
                    if stopping():
                        break
                    puts[due.topic](due.payload, due.time_ns)
                    heard(due.topic, due.time_ns, due.payload)
                    count += 1
                    if writer:
                        writer.write(due.topic, types[due.topic], due.payload, due.time_ns, due.topic in deterministic)
                if count == 0 and not stopping():
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


def _wait(when: float, stopping: Callable[[], bool], wait: Callable[[float], None]) -> None:
    while (left := when - time.perf_counter()) > 0.0 and not stopping():
        wait(min(left, 0.1))
