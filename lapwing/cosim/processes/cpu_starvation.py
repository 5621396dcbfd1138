"""CPU starvation: waiting time of ready processes for a processor, during which silence is not a stall.

Linux counts for each thread how long it ran, and how long it was ready to run and did not
(`/proc/PID/task/TID/schedstat`, first and second number [ns]). Neither grows while a thread is stopped or sleeps, nor
while it waits for a page of a file on a busy disk. Linux counts that for the whole machine
(`/proc/pressure/io` and `/proc/pressure/memory`, `total` of the line `some` [us]), and also the time in which a
hypervisor runs other machines (`/proc/stat`, `steal`).
"""

import os
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path

QUIET = 0.5  # [s] without a message after which the measurement starts
PRESSURE = (Path("/proc/pressure/io"), Path("/proc/pressure/memory"))
PROCESSORS = Path("/proc/stat")
STEAL = 8  # word of the first line of `PROCESSORS`


def starved_time(pid: int) -> float:
    """Return the time [s] that the threads of a process have waited for a processor; 0 if the system has no count."""
    return _scheduled(pid)[1]


def cpu_time(pid: int) -> float:
    """Return the time [s] that the threads of a process have run; 0 if the system has no count."""
    return _scheduled(pid)[0]


def _scheduled(pid: int) -> tuple[float, float]:
    run = wait = 0
    try:
        for thread in Path(f"/proc/{pid}/task").iterdir():
            counts = (thread / "schedstat").read_text().split()
            run, wait = run + int(counts[0]), wait + int(counts[1])
    except (OSError, IndexError, ValueError):  # it has ended, or the system has no such file
        return 0.0, 0.0
    return run * 1e-9, wait * 1e-9


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
        self._before: dict[str, float] = {}  # [s] waiting time by name
        self._run_before: dict[str, float] = {}  # [s] run time by name
        self._stall_before = 0.0  # [s] stall time of the machine
        self._pids: Mapping[str, int] = {}

    def look(self, pids: Mapping[str, int], silence: float) -> None:
        """Update the measurement of processes by name after `silence` [s] without a message from them."""
        self._pids = pids
        if silence < QUIET:
            self._before = {}
        elif not self._before:
            self._before = {name: starved_time(pid) for name, pid in pids.items()}
            self._run_before = {name: cpu_time(pid) for name, pid in pids.items()}
            self._stall_before = machine_stall_time()

    def of(self, names: Iterable[str]) -> float:
        """Return the total waiting time [s] of the named processes since the last message, and that of the machine."""
        if not self._before:
            return 0.0
        return self._total(starved_time, self._before, names) + machine_stall_time() - self._stall_before

    def run_time(self, names: Iterable[str]) -> float:
        """Return the total run time [s] of the named processes since the last message."""
        return self._total(cpu_time, self._run_before, names)

    def _total(self, time: Callable[[int], float], before: Mapping[str, float], names: Iterable[str]) -> float:
        measured = [name for name in names if name in self._before]
        return sum(max(0.0, time(self._pids[name]) - before[name]) for name in measured)
