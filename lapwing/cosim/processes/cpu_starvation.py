"""CPU starvation: time that ready processes have waited for a processor, during which silence is no stall.

Linux counts for each thread how long it ran, and how long it was ready to run and did not
(`/proc/PID/task/TID/schedstat`, first and second number [ns]). Neither grows while a thread is stopped or sleeps.
"""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

QUIET = 0.5  # [s] without news from which on it is measured


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
    except (OSError, IndexError, ValueError):  # it has ended, or a system that has not got this
        return 0.0, 0.0
    return run * 1e-9, wait * 1e-9


class Starvation:
    """Time that local processes have waited for a processor, or run, since the last message."""

    def __init__(self) -> None:
        self._before: dict[str, float] = {}  # by name: time waited
        self._run_before: dict[str, float] = {}  # by name: time run
        self._pids: Mapping[str, int] = {}

    def look(self, pids: Mapping[str, int], silence: float) -> None:
        """Look at processes, by name, of which there was no news for `silence` [s]."""
        self._pids = pids
        if silence < QUIET:
            self._before = {}
        elif not self._before:
            self._before = {name: starved_time(pid) for name, pid in pids.items()}
            self._run_before = {name: cpu_time(pid) for name, pid in pids.items()}

    def of(self, names: Iterable[str]) -> float:
        """Return the total time [s] that the named processes have waited since then."""
        return self._total(starved_time, self._before, names)

    def run_time(self, names: Iterable[str]) -> float:
        """Return the total time [s] that the named processes have run since then."""
        return self._total(cpu_time, self._run_before, names)

    def _total(self, time: Callable[[int], float], before: Mapping[str, float], names: Iterable[str]) -> float:
        known = [name for name in names if name in self._before]
        return sum(max(0.0, time(self._pids[name]) - before[name]) for name in known)
