"""Time-outs that do not count time in which a process got no CPU, or the machine waited (`machine_stall_time`)."""

import os
import time
from collections.abc import Callable

from lapwing.cosim.processes.cpu_starvation import machine_stall_time, starved_time

EXTENSION = 6.0  # limit of an extended time-out, as its multiple


class Patience:
    """A time-out that starts when it is created.

    Attributes:
        timeout: [s].
    """

    def __init__(
        self,
        timeout: float,
        *pids: int | None,
        longest: float | None = None,
        clock: Callable[[], float] = time.monotonic,
    ):
        """Start the time-out.

        Args:
            timeout: [s].
            pids: processes besides this one whose CPU starvation extends it; None for one on another machine.
            longest: [s] limit of the extended time-out; 6 times the time-out by default.
            clock: time [s].
        """
        self.timeout, self._clock = timeout, clock
        self._longest = EXTENSION * timeout if longest is None else longest
        self._pids = [pid for pid in (os.getpid(), *pids) if pid]
        self.restart()

    def restart(self) -> None:
        """Start the time-out again."""
        self._start = self._clock()
        self._before: dict[int, float] = {}
        self._stall_before = 0.0

    @property
    def over(self) -> bool:
        """True once the time-out has passed."""
        elapsed = self._clock() - self._start
        if elapsed > 0.5 * self.timeout and not self._before:  # reading it takes time, and most waits are short
            self._before = {pid: starved_time(pid) for pid in self._pids}
            self._stall_before = machine_stall_time()
        if elapsed <= self.timeout:
            return False
        starved = sum(max(0.0, starved_time(pid) - before) for pid, before in self._before.items())
        starved += machine_stall_time() - self._stall_before
        return elapsed > self._longest or elapsed - starved > self.timeout
