"""Timing of a playback: pace, pauses and single steps, and the part of the log that is played."""

import time
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

PAUSE, STEP, QUIT = " ", ".", "q"  # keys
POLL = 0.02  # [s] between two checks of the keys


class Pace:
    """Clock that releases messages at their time, or all messages of one instant per step during a pause."""

    def __init__(
        self,
        keys: Callable[[], str] = lambda: "",
        show: Callable[[str], None] = lambda line: None,
        wait: Callable[[float], None] = time.sleep,
        clock: Callable[[], float] = time.perf_counter,
    ):
        """Prepare a replay, which starts with the first call of `wait`.

        Args:
            keys: returns the keys that were typed since the last call.
            show: displays a pause, a step and their end.
            wait: waits at most a number of seconds.
            clock: returns the time [s].
        """
        self._keys, self._show, self._wait, self._clock = keys, show, wait, clock
        self._paused = self._step = self.quit = False
        self._stepped_ns = -1  # [ns] instant that is released during a pause
        self._next_poll = clock()
        self.begin()

    def begin(self) -> None:
        """Restart at the beginning of the log."""
        self._start = self._clock()
        self._stepped_ns = -1

    def wait(self, due: float, time_ns: int, stopping: Callable[[], bool]) -> None:
        """Wait until a message is released, or until stopped.

        Args:
            due: time of the message after the first one [s].
            time_ns: simulation time of the message.
            stopping: returns True to stop.
        """
        while not (stopping() or self.quit):
            self._handle_keys(due, time_ns)
            if self._paused:
                if self._step and time_ns != self._stepped_ns:
                    self._step, self._stepped_ns = False, time_ns
                    self._show(f"t = {time_ns * 1e-9:.9g} s")
                if time_ns == self._stepped_ns:
                    return
                self._wait(POLL)
                continue
            remaining = self._start + due - self._clock()
            if remaining <= 0.0:
                return
            self._wait(min(remaining, POLL))

    def _handle_keys(self, due: float, time_ns: int) -> None:
        """Execute typed commands."""
        if self._clock() < self._next_poll:
            return
        self._next_poll = self._clock() + POLL
        for key in self._keys():
            if key == PAUSE:
                self._paused, self._step, self._stepped_ns = not self._paused, False, -1
                self._start = self._clock() - due  # continue from here
                self._show(f"{'paused before' if self._paused else 'resumed at'} t = {time_ns * 1e-9:.9g} s")
            elif key == STEP:
                self._step = self._paused
            elif key == QUIT:
                self.quit = True


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
