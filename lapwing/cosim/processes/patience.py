"""Time-outs that do not count time in which a process got no CPU, or the machine waited (`machine_stall_time`).

They can also pause while a process is stopped or traced: somebody looks at it in a debugger.

Linux counts for each thread how long it ran, and how long it was ready to run and did not
(`/proc/PID/task/TID/schedstat`, first and second number [ns]). Neither grows while a thread is stopped or sleeps, nor
while it waits for a page of a file on a busy disk. Linux counts that for the whole machine
(`/proc/pressure/io` and `/proc/pressure/memory`, `total` of the line `some` [us]), and also the time in which a
hypervisor runs other machines (`/proc/stat`, `steal`).
"""

import os
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path

QUIET = 0.5  # [s] without a message after which the measurement starts
PRESSURE = (Path("/proc/pressure/io"), Path("/proc/pressure/memory"))
PROCESSORS = Path("/proc/stat")
STEAL = 8  # word of the first line of `PROCESSORS`


def starved_times(pid: int) -> Counter[int]:
    """Return for each thread of a process the time [ns] that it has waited for a processor; empty without a count."""
    return _scheduled(pid, 1)


def cpu_times(pid: int) -> Counter[int]:
    """Return for each thread of a process the time [ns] that it has run; empty if the system has no count."""
    return _scheduled(pid, 0)


def _scheduled(pid: int, column: int) -> Counter[int]:
    result = Counter[int]()
    with suppress(OSError):  # it has ended, or the system has no such folder
        for thread in Path(f"/proc/{pid}/task").iterdir():
            with suppress(OSError, IndexError, ValueError):  # it has ended
                result[int(thread.name)] = int((thread / "schedstat").read_text().split()[column])
    return result


def growth(now: Counter[int], before: Counter[int]) -> float:
    """Return the growth [s] of the times of all threads; one that has ended takes nothing from the others."""
    return 1e-9 * (now - before).total()


def machine_stall_time() -> float:
    """Return the time [s] since the start of the system in which the machine could not run its processes.

    It is the time in which any process waited for the disk or for memory, plus the time in which a hypervisor ran other
    machines; 0 for each that the system does not count."""
    result = 0.0
    for path in PRESSURE:
        with suppress(OSError, IndexError, ValueError):
            result += 1e-6 * int(path.read_text().split("\n", 1)[0].rpartition("total=")[2])
    with suppress(OSError, IndexError, ValueError):
        result += int(PROCESSORS.read_text().split("\n", 1)[0].split()[STEAL]) / os.sysconf("SC_CLK_TCK")
    return result


class Starvation:
    """Waiting time and run time of local processes since the last message."""

    def __init__(self) -> None:
        self._before: dict[str, Counter[int]] = {}  # waiting times by name
        self._run_before: dict[str, Counter[int]] = {}  # run times by name
        self._stall_before = 0.0  # [s] stall time of the machine
        self._pids: Mapping[str, int] = {}

    def look(self, pids: Mapping[str, int], silence: float) -> None:
        """Update the measurement of processes by name after `silence` [s] without a message from them."""
        self._pids = pids
        if silence < QUIET:
            self._before = {}
        elif not self._before:
            self._before = {name: starved_times(pid) for name, pid in pids.items()}
            self._run_before = {name: cpu_times(pid) for name, pid in pids.items()}
            self._stall_before = machine_stall_time()

    def of(self, names: Iterable[str]) -> float:
        """Return the total waiting time [s] of the named processes since the last message, and that of the machine."""
        if not self._before:
            return 0.0
        return self._total(starved_times, self._before, names) + machine_stall_time() - self._stall_before

    def run_time(self, names: Iterable[str]) -> float:
        """Return the total run time [s] of the named processes since the last message."""
        return self._total(cpu_times, self._run_before, names)

    def _total(
        self, times: Callable[[int], Counter[int]], before: Mapping[str, Counter[int]], names: Iterable[str]
    ) -> float:
        return sum(growth(times(self._pids[name]), before[name]) for name in names if name in before)


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
        self._before: dict[int, Counter[int]] = {}
        self._stall_before = 0.0

    @property
    def over(self) -> bool:
        """True once the time-out has passed."""
        elapsed = self._clock() - self._start
        if elapsed > LOOK * self.timeout and any(map(is_halted, self._pausing)):
            self.restart()
            return False
        if elapsed > 0.5 * self.timeout and not self._before:  # reading it takes time, and most waits are short
            self._before = {pid: starved_times(pid) for pid in self._pids}
            self._stall_before = machine_stall_time()
        if elapsed <= self.timeout:
            return False
        starved = sum(growth(starved_times(pid), before) for pid, before in self._before.items())
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
