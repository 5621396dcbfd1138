"""Print the digests of scenes, flown in this process: `python deploy/portability/digests.py SECONDS SCENE...`.

Runs under every system that `deploy/portability/compare.py` compares. SECONDS limits a flight; 0: no limit.
"""

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.golden.__main__ import fly
from tests.golden.cases import CASES


def main(seconds: float, names: list[str]) -> None:
    """Print a line `scene digest` for each scene."""
    for name in names or list(CASES):
        case = CASES[name]
        if seconds and case.resolve().last_tick > seconds * case.resolve().rate:
            case = case._replace(overrides=(*case.overrides, f"run.duration={seconds}"))
        start = time.monotonic()
        log, _ = fly(case)
        print(f"{name} {log.digest}", flush=True)
        print(f"{name}: {time.monotonic() - start:.0f} s", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main(float(sys.argv[1]), sys.argv[2:])
