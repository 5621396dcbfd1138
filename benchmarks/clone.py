"""What a fresh clone takes, its kernel cache empty and its packages installed before: minutes each.

python -m benchmarks.clone
"""

import subprocess
import tempfile
from pathlib import Path

from benchmarks._bars import Row, empty_cache, show, wall

SLOW = True  # left out by `python -m benchmarks --quick`
ROOT = Path(__file__).parent.parent


def rows():
    with tempfile.TemporaryDirectory() as folder:
        clone = Path(folder, "clone")
        subprocess.run(["git", "clone", "--quiet", str(ROOT), str(clone)], check=True)
        subprocess.run(["make", "--silent", ".venv/.clients"], cwd=clone, check=True)
        for target, bar in (("mission", 35.0), ("test", 600.0)):
            with empty_cache() as environment:
                taken = wall(["make", target], cwd=clone, env=environment)
            yield Row(f"make {target} in a fresh clone, packages installed", taken, "s", bar)
        with empty_cache() as environment:
            yield Row("the whole of .ci/run", wall([".ci/run"], cwd=clone, env=environment), "s", 1080.0)


def main():
    found = list(rows())
    show(found)
    return found


if __name__ == "__main__":
    main()
