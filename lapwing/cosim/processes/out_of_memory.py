"""Out-of-memory kills by the kernel: choice of the first victim in a run, and number of kills."""

from contextlib import suppress
from pathlib import Path

BEFORE_LAUNCHER = 500  # added to a child's badness (thousandths of the memory): the launcher survives and names it
COUNTERS = Path("/proc/vmstat")


def prefer_as_victim() -> None:
    """Make the kernel kill this process before its parent process. Other systems ignore the call."""
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
