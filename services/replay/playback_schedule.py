"""Which part of a log is replayed, and when each message is due: pure, no clock and no bus."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

SECOND = 1_000_000_000


class Cut(NamedTuple):
    """The part of a log that is replayed."""

    start_ns: int
    end_ns: int | None  # the first instant left out; None: to the end

    @classmethod
    def of(cls, start: float, end: float | None) -> "Cut":
        """From seconds of simulation time.

        Raises:
            ValueError: a negative time, or the end before the start.
        """
        if start < 0.0:
            raise ValueError(f"--from {start:g}: expected a time of 0 s or later")
        if end is not None and end < start:
            raise ValueError(f"--to {end:g}: expected a time not before --from {start:g}")
        return cls(round(start * SECOND), None if end is None else round(end * SECOND) + 1)


class Due(NamedTuple):
    """A message and when it is due."""

    wait: float  # [s] of wall time after the first message
    topic: str
    time_ns: int  # simulation time that it is stamped with
    payload: bytes


def schedule(messages: Iterable[tuple[str, str, int, bytes]], speed: float | None) -> Iterator[Due]:
    """When each message is due; speed None: all at once.

    Args:
        messages: (topic, type name, time [ns], payload) in the log's order.
        speed: simulated seconds per second.
    """
    first: int | None = None
    for topic, _, time_ns, payload in messages:
        first = time_ns if first is None else first
        yield Due(0.0 if speed is None else (time_ns - first) / SECOND / speed, topic, time_ns, payload)
