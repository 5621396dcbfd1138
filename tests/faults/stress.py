"""Many short runs at once on a busy machine: each must end without a signal and with a complete log.

    python -m tests.faults.stress --runs 2000 --at-once 6 --load 5 [--seconds 3000]

Cycles through the `KINDS` of runs. Every log must have the digest of the same scene in one process, which covers every
message, and a run must not print a fault. `--load` is the number of processes that only keep a processor busy. Prints a
line per batch; no run starts after `--seconds`. Exit code 1 if a run fails, prints a fault, or its log lacks a message.
"""

import argparse
import json
import os
import re
import resource
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from lapwing.cosim.log import LogReader

LAPWING = [sys.executable, "-m", "lapwing"]
MAVLINK = ["--mavlink", "udpout:127.0.0.1:9", "--speed", "max"]  # the discard port
FLEET = ["formation", "--set", "run.duration=0.3", "--set", "success.require=[]"]  # too short for a landing
KINDS = {
    "hover": ["hover", "--set", "run.duration=4"],
    "hover with MAVLink": ["hover", "--set", "run.duration=4", *MAVLINK],
    "fleet": FLEET,
    "fleet with MAVLink": [*FLEET, *MAVLINK],
}
TIMEOUT = 900.0  # [s] for one run
BATCH = 20  # runs per line of progress
FAULT = re.compile(r"ended before|unexpectedly|confirm|rejected:|incomplete")  # in the output of a failed run


class Result(NamedTuple):
    """Result of a run."""

    kind: str
    seconds: float
    wrong: str  # "" without error
    lost: int = 0  # messages that the log lacks


class Recorded(NamedTuple):
    """Content of a log."""

    digest: str
    messages: int

    @classmethod
    def of(cls, log: Path) -> "Recorded":
        with LogReader(log, skip_damaged=True) as reader:
            return cls(reader.metadata.get("digest", ""), sum(1 for _ in reader.messages()))


def reference(kind: str, folder: Path) -> Recorded:
    """Fly a kind of run in one process, which also compiles its kernels. Return the content of its log.

    MAVLink needs several processes: such a log is resimulated in one process to the same digest.
    """
    options, log = KINDS[kind], folder / f"{kind}.mcap"
    mode = [] if "--mavlink" in options else ["--mode", "single-process"]
    subprocess.run(
        [*LAPWING, "run", *options, *mode, "--log", str(log)], check=True, capture_output=True, timeout=TIMEOUT
    )
    if not mode:
        subprocess.run([*LAPWING, "resimulate", str(log)], check=True, capture_output=True, timeout=TIMEOUT)
    return Recorded.of(log)


def fly(kind: str, expected: Recorded, folder: Path, number: int) -> Result:
    """Run once and compare the log with `expected`."""
    log, figures = folder / f"{number}.mcap", folder / f"{number}.json"
    command = [*LAPWING, "run", *KINDS[kind], "--log", str(log), "--json", str(figures)]
    began = time.monotonic()
    done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT)
    seconds = time.monotonic() - began
    recorded = Recorded.of(log) if log.exists() else Recorded("", 0)
    lost = expected.messages - recorded.messages
    if done.returncode:
        fault = f"exit code {done.returncode}: {(done.stderr.strip() or 'no word')[-300:]}"
        return Result(kind, seconds, fault, lost)
    if lines := [line for line in (done.stdout + done.stderr).splitlines() if FAULT.search(line)]:
        return Result(kind, seconds, "; ".join(lines), lost)
    if not recorded.digest == json.loads(figures.read_text())["digest"] == expected.digest:
        return Result(kind, seconds, f"its log has {recorded}, expected {expected}", lost)
    for file in folder.glob(f"{number}.*"):
        file.unlink()
    return Result(kind, seconds, "")


@contextmanager
def busy(processes: int) -> Iterator[None]:
    """Keep processors busy within the context."""
    burning = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(processes)]
    try:
        yield
    finally:
        for process in burning:
            process.kill()
            process.wait()


def trial(runs: int, at_once: int, load: int, seconds: float = float("inf")) -> Iterator[Result]:
    """Yield the results of `runs`, `at_once` at a time beside `load` busy processes; start none after `seconds`."""
    until = time.monotonic() + seconds
    with tempfile.TemporaryDirectory(prefix="stress-") as name:
        folder = Path(name)
        expected = {kind: reference(kind, folder) for kind in KINDS}

        def fly_in_time(number: int) -> Result | None:
            kind = list(KINDS)[number % len(KINDS)]
            return fly(kind, expected[kind], folder, number) if time.monotonic() < until else None

        with busy(load), ThreadPoolExecutor(at_once) as pool:
            for result in pool.map(fly_in_time, range(runs)):
                if result is not None:
                    yield result


def main() -> None:
    """Run the trials and print the counts."""
    parser = argparse.ArgumentParser(description="Many short runs at once on a busy machine.")
    parser.add_argument("--runs", type=int, default=60)
    parser.add_argument("--at-once", type=int, default=6)
    parser.add_argument("--load", type=int, default=0, help="processes that keep a processor busy")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="after which no further run starts")
    values = parser.parse_args()
    tried, wrong, longest = Counter[str](), Counter[str](), Counter[str]()
    all_lost = 0
    results = trial(values.runs, values.at_once, values.load, values.seconds)
    for number, (kind, seconds, fault, lost) in enumerate(results):
        tried[kind] += 1
        all_lost += lost
        longest[kind] = max(longest[kind], seconds)
        if fault:
            wrong[kind] += 1
            print(f"run {number} ({kind}): {fault}", flush=True)
        if (number + 1) % BATCH == 0:
            total, used = tried.total(), resource.getrusage(resource.RUSAGE_CHILDREN)
            each = (used.ru_utime + used.ru_stime) / total
            print(
                f"{time.strftime('%H:%M:%S')} {total} tried, {total - wrong.total()} right, {all_lost} messages lost, "
                f"load {os.getloadavg()[0]:.0f}, {each:.1f} s of processor time per run",
                flush=True,
            )
    for kind in tried:
        print(f"{kind}: {tried[kind] - wrong[kind]} of {tried[kind]} right, the longest {longest[kind]:.0f} s")
    raise SystemExit(bool(wrong))


if __name__ == "__main__":
    main()
