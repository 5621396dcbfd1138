"""Runs with too little memory: in a memory cgroup with a limit, where the kernel kills a process.

The launcher names the killed process; there is no message if the kernel kills the launcher itself. In both cases
nothing is left behind.
"""

import os
import random
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

from tests.faults import leak_checks
from tests.faults.environments import ROOT, RUN, Outcome, ended_properly

GROUPS = Path("/sys/fs/cgroup/memory")  # version 1
UNIFIED = Path("/sys/fs/cgroup")  # version 2
LIMITS = (150, 330)  # [MB]
NAMED = "ended unexpectedly (signal 9)"
KILLED = (137, -9)  # exit codes of a launcher that was killed


def available() -> bool:
    """Return True if memory cgroups can be created here."""
    with suppress(OSError):
        _create("lapwing-probe", LIMITS[0]).rmdir()
        return True
    return False


def fly(seed: int, timeout: float) -> Outcome:
    """Run with the memory limit that a seed selects."""
    limit = random.Random(f"memory {seed}").randint(*LIMITS)
    name = f"{limit} MB of memory"
    group = _create(f"lapwing-chaos-{os.getpid()}-{seed}", limit)
    try:
        with tempfile.TemporaryDirectory(prefix="chaos-") as place:
            folder = Path(place)
            (folder / "tmp").mkdir()
            script = f'echo $$ > {group / "cgroup.procs"}; exec "$@"'
            command = ["sh", "-c", script, "sh", sys.executable, "-m", "lapwing", *RUN]
            environment = {**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": str(folder / "tmp")}
            try:
                done = subprocess.run(
                    command, cwd=folder, env=environment, capture_output=True, text=True, timeout=timeout
                )
            except subprocess.TimeoutExpired:
                return Outcome(name, -1, [f"has not ended after {timeout:g} s"])
            wrong = leak_checks.left(folder, {}, None, timeout)
        wrong += [f"processes {left} are left"] if (left := _emptied(group, timeout)) else []
        if done.returncode in KILLED:
            return Outcome(name, done.returncode, wrong)
        return Outcome(name, done.returncode, wrong + ended_properly(done))
    finally:
        with suppress(OSError):
            group.rmdir()


def _create(name: str, limit: int) -> Path:
    """Return a new group with a limit [MB]. Raise OSError if that is not permitted."""
    old = (GROUPS / "memory.limit_in_bytes").exists()
    group = (GROUPS if old else UNIFIED) / name
    if not old and not (UNIFIED / "cgroup.controllers").exists():
        raise FileNotFoundError(UNIFIED)
    group.mkdir()
    try:
        (group / ("memory.limit_in_bytes" if old else "memory.max")).write_text(str(limit * 1_000_000))
    except OSError:
        group.rmdir()
        raise
    return group


def _emptied(group: Path, timeout: float) -> str:
    """Return the ids of the processes that remain in a group after at most `timeout` [s]."""
    deadline = time.monotonic() + timeout
    while (left := " ".join((group / "cgroup.procs").read_text().split())) and time.monotonic() < deadline:
        time.sleep(0.1)
    return left
