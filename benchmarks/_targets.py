"""Measured figures and their targets."""

import subprocess
import sys
import time
from collections.abc import Iterable
from statistics import median
from typing import NamedTuple

LAPWING = [sys.executable, "-m", "lapwing"]


class Row(NamedTuple):
    """Measured figure and its target."""

    name: str
    measured: float
    unit: str
    target: float
    larger_is_better: bool = False

    @property
    def missed(self) -> bool:
        """True if the figure misses its target."""
        return self.measured < self.target if self.larger_is_better else self.measured > self.target


def show(rows: Iterable[Row]) -> list[Row]:
    """Print a table that marks missed targets. Return the rows."""
    rows = list(rows)
    print(f"{'':58}{'measured':>10}{'target':>11}")
    for row in rows:
        relation = ">=" if row.larger_is_better else "<="
        note = "  missed" if row.missed else ""
        print(f"{f'{row.name} [{row.unit}]':58}{row.measured:10.3g}{relation:>4}{row.target:7g}{note}", flush=True)
    print(f"{sum(row.missed for row in rows)} of {len(rows)} targets missed")
    return rows


def percentile(values: Iterable[float], share: float) -> float:
    """Return the value below which this share of the values lies."""
    ordered = sorted(values)
    return ordered[int(share * (len(ordered) - 1))]


def wall(command: list[str], repeats: int = 1, **options) -> float:
    """Return the median wall time [s] of a command; of several runs, a first one is not counted."""
    times = []
    for _ in range(repeats + 1 if repeats > 1 else 1):
        began = time.perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, **options)
        times.append(time.perf_counter() - began)
    return median(times[1:] or times)
