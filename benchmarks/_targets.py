"""Measured figures and their targets."""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import NamedTuple

LAPWING = [sys.executable, "-m", "lapwing"]


class Row(NamedTuple):
    """One figure."""

    what: str
    measured: float
    unit: str
    bar: float
    more: bool = False  # whether more is better

    @property
    def short(self) -> bool:
        """True if the figure misses its target."""
        return self.measured < self.bar if self.more else self.measured > self.bar


def show(rows: Iterable[Row]) -> list[Row]:
    """Print a table and what falls short; return the rows."""
    rows = list(rows)
    print(f"{'':58}{'measured':>10}{'bar':>11}")
    for row in rows:
        least = ">=" if row.more else "<="
        note = "  falls short" if row.short else ""
        print(f"{f'{row.what} [{row.unit}]':58}{row.measured:10.3g}{least:>4}{row.bar:7g}{note}", flush=True)
    print(f"{sum(row.short for row in rows)} of {len(rows)} fall short")
    return rows


def percentile(values: Iterable[float], share: float) -> float:
    """Return the value below which this share of the values lies."""
    ordered = sorted(values)
    return ordered[int(share * (len(ordered) - 1))]


@contextmanager
def empty_cache() -> Iterator[dict[str, str]]:
    """An environment with a kernel cache of its own, empty at first."""
    folder = tempfile.mkdtemp()
    try:
        yield {**os.environ, "LAPWING_CACHE": folder}
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def wall(command: list[str], repeats: int = 1, **options) -> float:
    """Seconds that a command takes, the median of some runs after one that is not counted (none if it is one)."""
    times = []
    for _ in range(repeats + 1 if repeats > 1 else 1):
        began = time.perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, **options)
        times.append(time.perf_counter() - began)
    return median(times[1:] or times)


def size_mb(path: Path) -> float:
    """Return the size of a file [MB]."""
    return path.stat().st_size / 1e6
