"""Processes that the kernel kills for lack of memory: which of a run's processes it takes first, and if it did."""

from contextlib import suppress
from pathlib import Path

BEFORE_LAUNCHER = 500  # added to a child's badness, in thousandths of the memory: the launcher lives and names it
COUNTERS = Path("/proc/vmstat")


def prefer_as_victim() -> None:
    """Let the kernel kill this process before the one that started it. Other systems ignore the call."""
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(str(BEFORE_LAUNCHER))


def kills() -> int:
    """Return the number of processes killed for lack of memory since the system started; 0 where it is unknown."""
    with suppress(OSError, ValueError):
        for line in COUNTERS.read_text().splitlines():
            name, _, count = line.partition(" ")
            if name == "oom_kill":
                return int(count)
    return 0
