"""CPU starvation: waiting time of ready processes for a processor, during which silence is not a stall.

Linux counts for each thread how long it ran, and how long it was ready to run and did not
(`/proc/PID/task/TID/schedstat`, first and second number [ns]). Neither grows while a thread is stopped or sleeps.
"""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

QUIET = 0.5  # [s] without a message after which the measurement starts


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


class Starvation:
    """Waiting time and run time of local processes since the last message."""

    def __init__(self) -> None:
        self._before: dict[str, float] = {}  # [s] waiting time by name
        self._run_before: dict[str, float] = {}  # [s] run time by name
        self._pids: Mapping[str, int] = {}

    def look(self, pids: Mapping[str, int], silence: float) -> None:
        """Update the measurement of processes by name after `silence` [s] without a message from them."""
        self._pids = pids
        if silence < QUIET:
            self._before = {}
        elif not self._before:
            self._before = {name: starved_time(pid) for name, pid in pids.items()}
            self._run_before = {name: cpu_time(pid) for name, pid in pids.items()}

    def of(self, names: Iterable[str]) -> float:
        """Return the total waiting time [s] of the named processes since the last message."""
        return self._total(starved_time, self._before, names)

    def run_time(self, names: Iterable[str]) -> float:
        """Return the total run time [s] of the named processes since the last message."""
        return self._total(cpu_time, self._run_before, names)

    def _total(self, time: Callable[[int], float], before: Mapping[str, float], names: Iterable[str]) -> float:
        measured = [name for name in names if name in self._before]
        return sum(max(0.0, time(self._pids[name]) - before[name]) for name in measured)
