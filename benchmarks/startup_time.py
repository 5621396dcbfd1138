"""Run time of short commands with all kernels in the cache.

python -m benchmarks.startup_time [--repeats N]
"""

import tempfile
from pathlib import Path

from benchmarks._command import command_line
from benchmarks._targets import LAPWING, Row, show, wall


def rows(repeats=5):
    with tempfile.TemporaryDirectory() as folder:
        fly = [*LAPWING, "run", "hover", "--log", str(Path(folder, "log.mcap")), "--key-prefix", "benchmark", "--mode"]
        yield Row("hover, one process, warm, whole command", wall([*fly, "single-process"], repeats), "s", 1.6)
        yield Row(
            "hover, a process for each service, warm, whole command", wall([*fly, "multi-process"], repeats), "s", 3.5
        )
    yield Row("lapwing --help", wall([*LAPWING, "--help"], repeats), "s", 0.3)
    yield Row("lapwing scenes", wall([*LAPWING, "scenes"], repeats), "s", 0.5)


def main(repeats: int = 5) -> list[Row]:
    return show(rows(repeats))


if __name__ == "__main__":
    command_line(main)
