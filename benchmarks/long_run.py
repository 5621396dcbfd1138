"""Peak memory of a run over its length, including metrics and report.

    python -m benchmarks.long_run [--most SECONDS]

The delivery mission, which hovers to the end of the run, in one process; 75, 150, 300 ... s up to MOST. Each run has a
separate process.
"""

import tempfile

from benchmarks._command import command_line
from benchmarks._targets import LAPWING
from benchmarks.campaign_scaling import measure_command

SLOW = True
HOVERS = ["--set", "trajectory.phase.2.duration=1e6"]


def main(most: int = 600) -> None:
    with tempfile.TemporaryDirectory() as folder:
        seconds = 75
        while seconds <= most:
            words = ["run", "delivery_mission", "--mode", "single-process", *HOVERS, "--set", f"run.duration={seconds}"]
            processor, peak = measure_command([*LAPWING, *words, "--log", f"{folder}/{seconds}.mcap"])
            print(
                f"{seconds:7} s simulated: {processor:6.1f} s of processor time, {peak:6.0f} MB at the most", flush=True
            )
            seconds *= 2


if __name__ == "__main__":
    command_line(main)
