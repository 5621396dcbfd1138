"""Many short runs at once on a busy machine: each has to end by itself, with a complete log.

    python -m tests.faults.stress --runs 2000 --at-once 6 --load 5

Takes turns at the `KINDS` of runs. Every log must have the digest that the same scene has in one process, to which
every message counts. `--load` is the number of processes that do nothing but keep a processor busy. Exit code 1 where a
run fails, or its log lacks a message.
"""

import argparse
import json
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
MAVLINK = ["--mavlink", "udpout:127.0.0.1:9", "--speed", "max"]  # the port that discards
FLEET = ["formation", "--set", "run.duration=0.3", "--set", "success.require=[]"]  # too short for a landing
KINDS = {
    "hover": ["hover", "--set", "run.duration=4"],
    "hover with MAVLink": ["hover", "--set", "run.duration=4", *MAVLINK],
    "fleet": FLEET,
    "fleet with MAVLink": [*FLEET, *MAVLINK],
}
TIMEOUT = 900.0  # [s] for one run


class Result(NamedTuple):
    """Result of a run."""

    kind: str
    seconds: float
    wrong: str  # "" where nothing is


def reference(kind: str, folder: Path) -> str:
    """The digest of a kind of run, flown in one process; compiles what the runs need.

    A link belongs to runs in processes only: there the log of one is flown again in one process, to the same digest.
    """
    options, log = KINDS[kind], folder / f"{kind}.mcap"
    mode = [] if "--mavlink" in options else ["--mode", "single-process"]
    subprocess.run(
        [*LAPWING, "run", *options, *mode, "--log", str(log)], check=True, capture_output=True, timeout=TIMEOUT
    )
    if not mode:
        subprocess.run([*LAPWING, "resimulate", str(log)], check=True, capture_output=True, timeout=TIMEOUT)
    with LogReader(log) as reader:
        return reader.metadata["digest"]


def fly(kind: str, expected: str, folder: Path, number: int) -> Result:
    """One run, whose log is to have the digest `expected`."""
    log, figures = folder / f"{number}.mcap", folder / f"{number}.json"
    command = [*LAPWING, "run", *KINDS[kind], "--log", str(log), "--json", str(figures)]
    began = time.monotonic()
    done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT)
    seconds = time.monotonic() - began
    if done.returncode:
        return Result(
            kind, seconds, f"exit code {done.returncode}: {(done.stderr.strip() or 'no word').splitlines()[-1]}"
        )
    with LogReader(log) as reader:
        recorded = reader.metadata["digest"]
    if not recorded == json.loads(figures.read_text())["digest"] == expected:
        return Result(kind, seconds, f"its log has the digest {recorded}, expected {expected}")
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


def trial(runs: int, at_once: int, load: int) -> Iterator[Result]:
    """So many runs, so many at once, beside so many processes that keep a processor busy."""
    with tempfile.TemporaryDirectory(prefix="stress-") as name:
        folder = Path(name)
        expected = {kind: reference(kind, folder) for kind in KINDS}
        kinds = [list(KINDS)[k % len(KINDS)] for k in range(runs)]
        with busy(load), ThreadPoolExecutor(at_once) as pool:
            flight = [pool.submit(fly, kind, expected[kind], folder, k) for k, kind in enumerate(kinds)]
            for run in flight:
                yield run.result()


def main() -> None:
    """Fly them, and count."""
    parser = argparse.ArgumentParser(description="Many short runs at once on a busy machine.")
    parser.add_argument("--runs", type=int, default=60)
    parser.add_argument("--at-once", type=int, default=6)
    parser.add_argument("--load", type=int, default=0, help="processes that keep a processor busy")
    values = parser.parse_args()
    flight, wrong, longest = Counter[str](), Counter[str](), Counter[str]()
    for number, (kind, seconds, fault) in enumerate(trial(values.runs, values.at_once, values.load)):
        flight[kind] += 1
        longest[kind] = max(longest[kind], seconds)
        if fault:
            wrong[kind] += 1
            print(f"run {number} ({kind}): {fault}", flush=True)
    for kind in flight:
        print(f"{kind}: {flight[kind] - wrong[kind]} of {flight[kind]} right, the longest {longest[kind]:.0f} s")
    raise SystemExit(bool(wrong))


if __name__ == "__main__":
    main()
