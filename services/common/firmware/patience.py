"""Time-outs that do not count time in which a firmware, or this process, got no CPU."""

import os
import time
from collections.abc import Callable

from lapwing.cosim.processes.cpu_starvation import starved_time
from lapwing.kernels import math

LONGEST = 6.0  # multiple of the time-out, from which CPU starvation no longer extends it


class Patience:
    """A time-out that starts when it is created."""

    def __init__(self, timeout: float, pid: int | None = None, clock: Callable[[], float] = time.monotonic):
        """Start the time-out.

        Args:
            timeout: [s].
            pid: process of the firmware, None if another host or user runs it.
            clock: time [s].
        """
        self._timeout, self._clock = timeout, clock
        self._pids = [os.getpid(), *([pid] if pid else [])]
        self.restart()

    def restart(self) -> None:
        """Start the time-out again."""
        self._start = self._clock()
        self._before: dict[int, float] = {}

    @property
    def over(self) -> bool:
        """True once the time-out has passed."""
        elapsed = self._clock() - self._start
        if elapsed > 0.5 * self._timeout and not self._before:  # reading it takes time, and most waits are short
            self._before = {pid: starved_time(pid) for pid in self._pids}
        if elapsed <= self._timeout:
            return False
        starved = math.total(max(0.0, starved_time(pid) - before) for pid, before in self._before.items())
        return elapsed > LONGEST * self._timeout or elapsed - starved > self._timeout
