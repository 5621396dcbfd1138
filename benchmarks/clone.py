"""Minutes that a fresh clone takes with an empty kernel cache and installed packages.

python -m benchmarks.clone
"""

import re
import subprocess
import tempfile
from pathlib import Path

from benchmarks._targets import Row, empty_cache, said_within, show, wall

SLOW = True  # left out by `python -m benchmarks --quick`
ROOT = Path(__file__).parent.parent
PEAK = re.compile(r"peak memory: .*")


def rows():
    with tempfile.TemporaryDirectory() as folder:
        clone = Path(folder, "clone")
        subprocess.run(["git", "clone", "--quiet", str(ROOT), str(clone)], check=True)
        subprocess.run(["make", "--silent", ".venv/.clients"], cwd=clone, check=True)
        with empty_cache() as environment:
            taken = wall(["make", "mission"], cwd=clone, env=environment)
        yield Row("make mission in a fresh clone, packages installed", taken, "s", 35.0)
        with empty_cache() as environment:
            taken, said = said_within(["make", "test"], cwd=clone, env=environment)
            yield Row("make test in a fresh clone, packages installed", taken, "s", 600.0)
            yield Row("the largest worker of make test", peak_mb(said), "MB", 1500.0)
            taken, _ = said_within(["make", "quick"], cwd=clone, env=environment)
            yield Row("make quick, warm", taken, "s", 90.0)
        with empty_cache() as environment:
            yield Row("the whole of .ci/run", wall([".ci/run"], cwd=clone, env=environment), "s", 1080.0)


def peak_mb(said: str) -> float:
    """Return the peak memory of the largest worker [MB] from the output of `make test`."""
    (line,) = PEAK.findall(said)
    return max(float(number) for number in re.findall(r"(\d+) MB", line))


def main():
    result = []
    try:
        for row in rows():
            result.append(row)
    finally:
        show(result)
    return result


if __name__ == "__main__":
    main()
