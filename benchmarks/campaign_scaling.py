"""Processor time per run and peak memory of campaigns of increasing size, including the report.

    python -m benchmarks.campaign_scaling [--most RUNS]

Two seconds of hover on one worker, 100, 1000, 10000 ... runs, each campaign in a separate process.
"""

import os
import subprocess
import tempfile
from itertools import pairwise

from benchmarks._command import command_line
from benchmarks._targets import LAPWING, Row, show

CAMPAIGN = [*LAPWING, "campaign", "hover", "--set", "run.duration=2", "--workers", "1"]


def main(most: int = 10000) -> list[Row]:
    counts, cost = [10**k for k in range(2, 9) if 10**k <= most], {}
    with tempfile.TemporaryDirectory() as folder:
        measure_command([*CAMPAIGN, "--runs", "1", "--out", f"{folder}/warm"])
        for runs in counts:
            cost[runs] = measure_command([*CAMPAIGN, "--runs", str(runs), "--out", f"{folder}/{runs}"])
            print(f"{runs:9} runs: {cost[runs][0]:8.1f} s, {cost[runs][1]:5.0f} MB", flush=True)
    each = [(cost[b][0] - cost[a][0]) / (b - a) for a, b in pairwise(counts)]  # [s] for every further run
    for runs, further in zip(counts[1:], each, strict=True):
        print(f"up to {runs:9} runs: {1e3 * further:.2f} ms for each further run")
    result = [
        Row(f"campaign: cost of a further run, up to {most} to up to 1000 runs", each[-1] / each[0], "", 1.1),
        Row(f"campaign: peak memory, {most} runs to 1000", cost[most][1] / cost[1000][1], "", 1.1),
    ]
    return show(result)


def measure_command(command):
    """Return processor time [s] and peak memory [MB] of a command."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise subprocess.CalledProcessError(os.waitstatus_to_exitcode(status), command)
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024.0


if __name__ == "__main__":
    command_line(main)
