"""Replay schedule: the messages of a part of a log and their times, without clock and bus."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

SECOND = 1_000_000_000


class Cut(NamedTuple):
    """The part of a log that is replayed."""

    start_ns: int
    end_ns: int | None  # first instant after the part; None: to the end

    @classmethod
    def of(cls, start: float, end: float | None) -> "Cut":
        """Return the part between two simulation times [s].

        Raises:
            ValueError: a time is negative, or the end is before the start.
        """
        if start < 0.0:
            raise ValueError(f"--from {start:g}: expected a time of 0 s or later")
        if end is not None and end < start:
            raise ValueError(f"--to {end:g}: expected a time not before --from {start:g}")
        return cls(round(start * SECOND), None if end is None else round(end * SECOND) + 1)


class Due(NamedTuple):
    """A message and its due time."""

    wait: float  # [s] of wall time after the first message
    topic: str
    time_ns: int  # its simulation time stamp
    payload: bytes


def schedule(messages: Iterable[tuple[str, str, int, bytes]], speed: float | None) -> Iterator[Due]:
    """Yield each message with its due time, 0 if `speed` is None.

    Args:
        messages: (topic, type name, time [ns], payload) in the order of the log.
        speed: simulated seconds per second.
    """
    first: int | None = None
    for topic, _, time_ns, payload in messages:
        first = time_ns if first is None else first
        yield Due(0.0 if speed is None else (time_ns - first) / SECOND / speed, topic, time_ns, payload)
