"""Time-outs that do not count time in which a process got no CPU, or the machine waited (`machine_stall_time`).

They can also pause while a process is stopped or traced: somebody looks at it in a debugger.
"""

import os
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from lapwing.cosim.processes.cpu_starvation import machine_stall_time, starved_time

EXTENSION = 6.0  # limit of an extended time-out, as its multiple
LOOK = 0.05  # part of a time-out after which the states of the processes are read


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
        pauses: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ):
        """Start the time-out.

        Args:
            timeout: [s].
            pids: processes besides this one whose CPU starvation extends it; None for one on another machine.
            longest: [s] limit of the extended time-out; 6 times the time-out by default.
            pauses: True to start again while one of `pids` is stopped or traced.
            clock: time [s].
        """
        self.timeout, self._clock = timeout, clock
        self._pausing = [pid for pid in pids if pid and pauses]
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
        if elapsed > LOOK * self.timeout and any(map(is_halted, self._pausing)):
            self.restart()
            return False
        if elapsed > 0.5 * self.timeout and not self._before:  # reading it takes time, and most waits are short
            self._before = {pid: starved_time(pid) for pid in self._pids}
            self._stall_before = machine_stall_time()
        if elapsed <= self.timeout:
            return False
        starved = sum(max(0.0, starved_time(pid) - before) for pid, before in self._before.items())
        starved += machine_stall_time() - self._stall_before
        return elapsed > self._longest or elapsed - starved > self.timeout


def process_state(pid: int, key: str = "State") -> str:
    """Return the first word of an entry of `/proc/PID/status`; "" if it has ended, or the system has no such file.

    The state is R (runs), S and D (waits), T and t (stopped, by a signal or a debugger), Z and X (ended).
    """
    with suppress(OSError, IndexError):
        return Path(f"/proc/{pid}/status").read_text().partition(f"\n{key}:")[2].split()[0]
    return ""


def is_halted(pid: int) -> bool:
    """Return True if a process is stopped or traced."""
    return process_state(pid) in ("T", "t") or process_state(pid, "TracerPid") not in ("", "0")
