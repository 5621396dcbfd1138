"""Faults of a campaign: it ends as expected, and the same command continues to the undisturbed table."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.commands import run_command
from tests.faults import leak_checks

KILL, WORKER, INTERRUPT = "campaign kill", "campaign worker", "campaign Ctrl-C"
COMMAND = ["campaign", "hover", "--runs", "40", "--set", "run.duration=2", "--workers", "2"]
SHARE = {KILL: 0.7, WORKER: 0.25, INTERRUPT: 0.7}  # of a trial's delay, from the start of the command or its workers
ROOT = Path(__file__).parents[2]
LONGEST = 600.0  # [s] for a complete campaign that compiles its kernels


def _killed(code: int, text: str) -> bool:
    return (code, text) == (-signal.SIGKILL, "")


def _lost(code: int, text: str) -> bool:
    line = r"lapwing: a worker process has ended unexpectedly.*; run the same command again to continue\n"
    return code == 1 and re.fullmatch(line, text) is not None


def _interrupted(code: int, text: str) -> bool:
    line = r"lapwing: ended by SIGINT(; \d+ of 40 runs are kept; run the same command again to continue)?\n"
    return code == 130 and re.fullmatch(line, text) is not None


KINDS: dict[str, Callable[[int, str], bool]] = {KILL: _killed, WORKER: _lost, INTERRUPT: _interrupted}


def fly(
    kind: str, place: float, delay: float, cold: bool, folder: Path, timeout: float
) -> tuple[str, int, str, float, list[str]]:
    """Apply a fault to a campaign. Return the victim, exit code, standard error, seconds to the last exit, and errors.

    Args:
        kind: one of `KINDS`.
        place: worker, in [0, 1]; Ctrl-C below 0.5 reaches the command only, otherwise all processes, as in a terminal.
        delay: [s] before the fault.
        cold: True for an empty kernel cache.
        folder: for all output.
        timeout: [s] until the end of the campaign.
    """
    own, out = folder / "tmp", folder / "out"
    own.mkdir()
    kernels = folder / "cache" if cold else None
    environment = {**os.environ, "TMPDIR": str(own), **({"LAPWING_CACHE": str(kernels)} if kernels else {})}
    command = [sys.executable, "-m", "lapwing", *COMMAND, "--out", str(out)]
    with (folder / "said").open("w+") as output:
        started = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=output, env=environment, cwd=ROOT, start_new_session=True
        )
        while kind == WORKER and started.poll() is None and not _workers(folder):
            time.sleep(0.02)
        time.sleep(SHARE[kind] * delay)
        workers = _workers(folder)
        victim = "worker" if kind == WORKER else "all" if kind == INTERRUPT and place >= 0.5 else "command"
        over = started.poll() is not None
        taken = leak_checks.ports(leak_checks.of_trial(folder))
        struck = time.monotonic()
        with suppress(ProcessLookupError):
            if victim == "worker" and workers:
                os.kill(workers[min(int(place * len(workers)), len(workers) - 1)], signal.SIGKILL)
            elif victim == "all":
                os.killpg(started.pid, signal.SIGINT)
            elif victim == "command" and not over:
                os.kill(started.pid, signal.SIGINT if kind == INTERRUPT else signal.SIGKILL)
        wrong = leak_checks.ended(started, "command", timeout)
        wrong += leak_checks.left(folder, taken, kernels, timeout)
        seconds = time.monotonic() - struck
        for process in leak_checks.of_trial(folder):
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
        output.seek(0)
        code, text = started.returncode, output.read()
    if not KINDS[kind](code, text) and (code, text) != (0, ""):
        wrong.append(f"exit code {code}: {text!r}")
    if kind != KILL and (result := [path.name for place in (own, out) for path in place.glob("*/.*")]):
        wrong.append(f"left behind: {', '.join(result)}")
    return victim, code, text.strip(), seconds, wrong + _continues(command, environment, out)


def _continues(command: list[str], environment: dict[str, str], out: Path) -> list[str]:
    """Return the problems of running the same command again."""
    again = subprocess.run(command, env=environment, cwd=ROOT, capture_output=True, text=True, timeout=LONGEST)
    if (again.returncode, again.stderr) != (0, ""):
        return [f"does not continue: exit code {again.returncode}: {again.stderr!r}"]
    result, expected = _digest(again.stdout), undisturbed()
    return [] if result == expected else [f"digest {result} after continuation, expected {expected}"]


@cache
def undisturbed() -> str:
    """Return the digest of a campaign without a fault."""
    with TemporaryDirectory() as folder:
        flight = run_command(*COMMAND, "--out", f"{folder}/out", code=0, folder=ROOT)
        return _digest(flight.stdout)


def _digest(text: str) -> str:
    result = re.search(r"^digest +([0-9a-f]{32})$", text, re.MULTILINE)
    assert result, text
    return result[1]


def _workers(folder: Path) -> list[int]:
    """Return the ids of a campaign's worker processes."""
    result = []
    for process in sorted(leak_checks.of_trial(folder)):
        with suppress(OSError):
            if b"spawn_main" in Path(f"/proc/{process}/cmdline").read_bytes():
                result.append(process)
    return result
