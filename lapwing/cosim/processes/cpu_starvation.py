"""CPU starvation: time that ready processes have waited for a processor, during which silence is no stall.

Linux counts for each thread how long it was ready to run and did not (`/proc/PID/task/TID/schedstat`, second number
[ns]); that of a thread that is stopped, sleeps or runs does not grow.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path

QUIET = 0.5  # [s] without news from which on it is measured


def starved_time(pid: int) -> float:
    """Return the time [s] that the threads of a process have waited for a processor; 0 if the system has no count."""
    total = 0
    try:
        for thread in Path(f"/proc/{pid}/task").iterdir():
            total += int((thread / "schedstat").read_text().split()[1])
    except (OSError, IndexError, ValueError):  # it has ended, or a system that has not got this
        return 0.0
    return total * 1e-9


class Starvation:
    """Time that local processes have waited for a processor since the last message."""

    def __init__(self) -> None:
        self._before: dict[str, float] = {}
        self._pids: Mapping[str, int] = {}

    def look(self, pids: Mapping[str, int], silence: float) -> None:
        """Look at processes, by name, of which there was no news for `silence` [s]."""
        self._pids = pids
        if silence < QUIET:
            self._before = {}
        elif not self._before:
            self._before = {name: starved_time(pid) for name, pid in pids.items()}

    def of(self, names: Iterable[str]) -> float:
        """Return the total time [s] that the named processes have waited since then."""
        return sum(
            max(0.0, starved_time(self._pids[name]) - self._before[name]) for name in names if name in self._before
        )
