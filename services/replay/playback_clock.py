"""Replay clock: releases messages in real time, or step by step on key presses."""

import time
from collections.abc import Callable

PAUSE, STEP, QUIT = " ", ".", "q"  # keys
POLL = 0.02  # [s] between two looks at the keys


class Pace:
    """Lets messages go at their time; a pause holds them, a step lets all of the next instant go."""

    def __init__(
        self,
        keys: Callable[[], str] = lambda: "",
        say: Callable[[str], None] = lambda line: None,
        wait: Callable[[float], None] = time.sleep,
        clock: Callable[[], float] = time.perf_counter,
    ):
        """Prepare a replay that begins with the first call of `wait`.

        Args:
            keys: what has been typed since the call before.
            say: shows a pause, a step and their end.
            wait: waits so many seconds, or less.
            clock: [s].
        """
        self._keys, self._say, self._wait, self._clock = keys, say, wait, clock
        self._paused = self._step = self.quit = False
        self._stepped_ns = -1  # the instant that may go in a pause
        self._next_look = clock()
        self.begin()

    def begin(self) -> None:
        """Restart at the beginning of the log."""
        self._started = self._clock()
        self._stepped_ns = -1

    def wait(self, due: float, time_ns: int, stopping: Callable[[], bool]) -> None:
        """Return when a message may go, or when to stop.

        Args:
            due: when, after the first message [s].
            time_ns: its simulation time.
            stopping: says whether to end.
        """
        while not (stopping() or self.quit):
            self._look(due, time_ns)
            if self._paused:
                if self._step and time_ns != self._stepped_ns:
                    self._step, self._stepped_ns = False, time_ns
                    self._say(f"t = {time_ns * 1e-9:.9g} s")
                if time_ns == self._stepped_ns:
                    return
                self._wait(POLL)
                continue
            left = self._started + due - self._clock()
            if left <= 0.0:
                return
            self._wait(min(left, POLL))

    def _look(self, due: float, time_ns: int) -> None:
        """Execute typed commands."""
        if self._clock() < self._next_look:
            return
        self._next_look = self._clock() + POLL
        for key in self._keys():
            if key == PAUSE:
                self._paused, self._step, self._stepped_ns = not self._paused, False, -1
                self._started = self._clock() - due  # continues from here
                self._say(f"{'paused before' if self._paused else 'resumed at'} t = {time_ns * 1e-9:.9g} s")
            elif key == STEP:
                self._step = self._paused
            elif key == QUIT:
                self.quit = True
