"""Cycle time of the lock step compared with equal federations of HELICS and mosaik, interleaved in one run.

    python -m benchmarks.federations [--cycles N] [--repeats N]

Plant, sensors, autopilot and trajectory, each in a process, exchange the same numbers at every tick as in
`benchmarks.lockstep`, without computation. A cycle is plant, sensors, autopilot, plant. The data have the most suitable
form: raw bytes over ZeroMQ for HELICS, lists of numbers for mosaik. Packages that are not installed (extra `bench`) are
skipped.
"""

import json
import os
import socket
import subprocess
import sys
from importlib.util import find_spec
from itertools import pairwise
from statistics import median

from benchmarks import lockstep
from benchmarks._targets import Row, show
from benchmarks.lockstep import PARTS

OTHERS = {"HELICS": "helics", "mosaik": "mosaik"}  # packages; the module of the same name has the processes
PATIENCE = 120.0  # [s] limit of a federation


def main(cycles: int = 1000, repeats: int = 1) -> list[Row]:
    result, others = [], [name for name, package in OTHERS.items() if find_spec(package)]
    for name in OTHERS.keys() - others:
        print(f"{name} is not installed: pip install 'lapwing[bench]'")
    for placing, core in (("one core", 0), ("free", None)):
        times = {name: [] for name in ("lock step", *others)}
        for _ in range(repeats):
            times["lock step"].append(median(lockstep.measure("lockstep", cycles, core)))
            for name in others:
                times[name].append(median(measure(OTHERS[name], cycles, core)))
        for name, seconds in times.items():
            print(f"{name:10} ({placing:8}): {1e6 * median(seconds):8.0f} us a cycle")
        for name in others:
            ratio = median(b / a for a, b in zip(times["lock step"], times[name], strict=True))
            result.append(Row(f"cycle of {name} to one of the lock step, {placing}", ratio, "", 3.0, True))
    return show(result)


def measure(package, cycles, core):
    """Return the duration [s] of each cycle of a federation."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    module, more = f"benchmarks.federations.{package}_federation", [str(cycles), json.dumps(core), str(port)]
    roles = ["broker"] if package == "mosaik" else ["broker", *PARTS]  # mosaik starts the other processes
    children = [
        subprocess.Popen(
            [sys.executable, "-m", module, name, *more], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        for name in roles
    ]
    try:
        output = [child.communicate(timeout=PATIENCE)[0] for child in children]
    finally:
        for child in children:
            child.kill()
    stamps = [line for line in "".join(output).splitlines() if line.startswith("[")]  # mosaik prints a greeting, too
    if not stamps:
        raise RuntimeError(f"{package}: the federation did not start within {PATIENCE:g} s")
    seconds = [b - a for a, b in pairwise(json.loads(stamps[0]))]
    return seconds[len(seconds) // 10 :]  # without the start-up


def pin(core):
    """Run this process and its children on one core only; None: on any core."""
    if core is not None:
        os.sched_setaffinity(0, {core})
