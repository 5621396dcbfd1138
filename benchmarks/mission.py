"""Real-time factor of the delivery mission in several processes and in one.

    python -m benchmarks.mission [--repeats N]

The log is written in both modes. Kernels are compiled before the measurement.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

from benchmarks._command import command_line
from benchmarks._targets import Row, show

SCENE = "lapwing/scenes/delivery_mission.toml"


def fly(mode, folder):
    """Return the results of one run."""
    figures = Path(folder, "figures.json")
    arguments = ["run", SCENE, "--mode", mode, "--log", str(Path(folder, "log.mcap")), "--json", str(figures)]
    subprocess.run([sys.executable, "-m", "lapwing", *arguments, "--key-prefix", "benchmark"], check=True,
                   stdout=subprocess.DEVNULL)  # fmt: skip
    return json.loads(figures.read_text())


def main(repeats: int = 3) -> list[Row]:
    with tempfile.TemporaryDirectory() as folder:
        fly("single-process", folder)
        runs = {mode: [fly(mode, folder) for _ in range(repeats)] for mode in ("multi-process", "single-process")}
        assert len({run["digest"] for mode in runs.values() for run in mode}) == 1, "the digests differ"
        size = Path(folder, "log.mcap").stat().st_size / 1e6
    factor = {mode: median(run["real_time_factor"] for run in figures) for mode, figures in runs.items()}
    result = [
        Row("mission, one process, to real time", factor["single-process"], "", 150.0, True),
        Row("mission, a process for each service, to real time", factor["multi-process"], "", 18.6, True),
        Row("log of the mission", size, "MB", 5.0),
    ]
    return show(result)


if __name__ == "__main__":
    command_line(main)
