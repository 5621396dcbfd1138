"""Trials with signals at random times, broken environments and too little memory, within a time limit.

    python -m tests.faults.chaos [--seed S] [--seconds 600] [--signals 200] [--environments 60] [--memory 10] [--jobs J]

Prints each failed trial, and the numbers of tried and successful trials by kind. Exit code 1 if a trial failed.
"""

import argparse
import os
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

from tests.faults import environments, memory_pressure, trial

SIGNALS = ("kill", "terminate", "freeze", "pause", "Ctrl-C")
SHARE, ENVIRONMENTS = 0.7, 0.9  # of the time, until which signals and environments are tried
LATEST = 5.0  # [s] from the start of the processes to the fault
TIMEOUT = 180.0  # [s] until a trial must end on a busy machine

Result = tuple[str, str, list[str]]  # kind, description, faults


def signalled(seed: int) -> Result:
    """Run the signal trial of a seed."""
    drawn = trial.draw(seed, SIGNALS)
    drawn = drawn._replace(scene="hover" if seed % 4 else drawn.scene, delay=drawn.delay * LATEST / trial.LATEST)
    outcome = trial.fly(drawn, TIMEOUT)
    return f"signal: {drawn.kind}", f"{drawn.scene} {outcome.victim} {drawn.delay:.2f} s", outcome.wrong


def broken(seed: int) -> Result:
    """Run in the environment that a seed selects."""
    outcome = environments.fly(seed, TIMEOUT)
    return "environment", outcome.name, outcome.wrong


def starved(seed: int) -> Result:
    """Run with the memory limit that a seed selects."""
    outcome = memory_pressure.fly(seed, TIMEOUT)
    return "memory", outcome.name, outcome.wrong


def trials(attempt: Callable[[int], Result], seeds: range, jobs: int, until: float) -> Iterator[tuple[int, Result]]:
    """Yield the results by seed until the time `until`."""

    def in_time(seed: int) -> Result | None:
        return attempt(seed) if time.monotonic() < until else None

    with ThreadPoolExecutor(jobs) as pool:
        for seed, result in zip(seeds, pool.map(in_time, seeds), strict=True):
            if result is not None:
                yield seed, result


def main() -> None:
    """Run the trials, print failures and counts."""
    parser = argparse.ArgumentParser(description="Signals at random moments and broken environments.")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=600.0, help="for all trials")
    parser.add_argument("--signals", type=int, default=200)
    parser.add_argument("--environments", type=int, default=60)
    parser.add_argument("--memory", type=int, default=10, help="where memory cgroups can be created")
    parser.add_argument("--jobs", type=int, default=2 * (os.cpu_count() or 1), help="trials at once")
    options = parser.parse_args()
    began = time.monotonic()
    tried: Counter[str] = Counter()
    right: Counter[str] = Counter()
    parts = [(signalled, options.signals, SHARE), (broken, options.environments, ENVIRONMENTS)]
    if memory_pressure.available():
        parts.append((starved, options.memory, 1.0))
    elif options.memory:
        print("memory: left out, this user cannot create memory cgroups")
    for attempt, count, share in parts:
        seeds = range(options.seed, options.seed + count)
        for seed, (kind, name, faults) in trials(attempt, seeds, options.jobs, began + share * options.seconds):
            tried[kind] += 1
            right[kind] += not faults
            if faults:
                print(f"seed {seed}, {kind}, {name}: {'; '.join(faults)}", flush=True)
    for kind in sorted(tried):
        print(f"{kind}: {tried[kind]} tried, {right[kind]} right")
    print(f"all: {tried.total()} tried, {right.total()} right, {time.monotonic() - began:.0f} s, seed {options.seed}")
    raise SystemExit(right.total() < tried.total())


if __name__ == "__main__":
    main()
