"""Plan of a campaign: scene, number of runs, and varied keys.

The drawn values of a run depend only on the campaign's seed, the run's number and the key, not on the order of the runs
or the workers. In a design over all runs they also depend on the number of runs.
"""

import csv
import hashlib
import io
import math
import warnings
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lapwing.cosim.scene.overrides import value_of
from lapwing.dynamics.input_file import read_text, unreadable
from lapwing.studies.campaign.distributions import Distribution

SEED_STRIDE = 2**32  # between the seeds of two campaigns
SEED = "run.seed"
MAX_RUNS = 10_000_000  # limit of a campaign


class Plan(NamedTuple):
    """Plan of a campaign: scene, runs and varied keys."""

    path: str  # path or name of the scene
    overrides: tuple[str, ...]
    seed: int
    runs: int
    vary: tuple[tuple[str, Distribution], ...]  # by key, sorted
    sweep: tuple[dict[str, Any], ...] = ()  # values by key; run k uses entry k modulo their number
    design: str = "random"  # one of `_DESIGNS`

    @property
    def keys(self) -> list[str]:
        """Varied keys."""
        return [*(key for key, _ in self.vary), *(self.sweep[0] if self.sweep else ())]

    def argument(self, key: str) -> str:
        """Return the argument of `plan` that varies a key; "" if there is none."""
        if any(key == name for name, _ in self.vary):
            return "vary"
        return "sweep: column" if key in self.keys else ""

    def seed_of(self, run: int) -> int:
        """Return the seed of a run: 1, 2, ... of campaign 1; no two campaigns share a seed."""
        return (self.seed - 1) * SEED_STRIDE + run + 1

    def with_absolute_path(self) -> "Plan":
        """Return the plan with absolute paths, for workers with another working directory."""
        path = Path(self.path)
        return self._replace(path=str(path.absolute())) if path.is_file() else self

    def values(self, run: int) -> dict[str, Any]:
        """Return the drawn values of a run by key."""
        independent = dict(zip((key for key, _ in self.vary), _DESIGNS[self.design](self, run), strict=True))
        drawn = {key: distribution.at(distribution.quantile(independent, key)) for key, distribution in self.vary}
        return drawn | (self.sweep[run % len(self.sweep)] if self.sweep else {})

    def overrides_of(self, run: int) -> dict[str, Any]:
        """Return all overrides of a run, including its seed."""
        return {**self.values(run), SEED: self.seed_of(run)}


def plan(
    path: str,
    overrides: Iterable[str] = (),
    runs: int | None = None,
    seed: int = 1,
    vary: Mapping[str, Distribution] | None = None,
    sweep: Path | None = None,
    design: str = "random",
) -> Plan:
    """Return a plan.

    Args:
        path: path or name of the scene.
        overrides: KEY=VALUE of every run, of other keys than `SEED`.
        runs: number of runs; by default the entries of the sweep, the points of the grid, or 100.
        seed: seed of the campaign.
        vary: distribution by key.
        sweep: CSV file with a column per key and a line per run, for correlated values.
        design: sampling of the varied keys: independent, Latin hypercube, scrambled Sobol sequence, or a grid of all
            combinations of finitely many values.

    Raises:
        ValueError: an argument is invalid; the message begins with its name.
    """
    distributions, sweep_rows = tuple(sorted((vary or {}).items())), _read_sweep(sweep) if sweep else ()
    if duplicates := sorted(set(vary or {}) & set(sweep_rows[0] if sweep_rows else ())):
        raise ValueError(f"vary {duplicates[0]}: also varied by the sweep {sweep}; use one of both")
    for key, distribution in distributions:
        if missing := [other for other, _ in distribution.weights if other not in (vary or {})]:
            raise ValueError(f"vary {key}: is correlated with {missing[0]}, which does not vary; vary both")
    if argument := Plan(path, (), seed, 1, distributions, sweep_rows).argument(SEED):
        raise ValueError(f"{argument} {SEED}: each run has its own seed, by the seed of the campaign; leave it out")
    if design not in _DESIGNS:
        raise ValueError(f"design {design}: expected one of {', '.join(_DESIGNS)}")
    if design in ("lhs", "sobol") and not distributions:
        raise ValueError(f"design {design}: expected a key that varies")
    points = math.prod(len(d.values) for _, d in distributions if d.values)
    if design == "grid" and not any(d.values for _, d in distributions):
        raise ValueError("design grid: expected a key that varies by choice(...) or linspace(...)")
    if runs is None:
        runs = len(sweep_rows) or (points if design == "grid" else 100)
    if not 1 <= runs <= MAX_RUNS:
        raise ValueError(f"runs {runs}: expected a number from 1 to {MAX_RUNS}")
    if not 1 <= seed < 2**63 // SEED_STRIDE:
        raise ValueError(f"seed {seed}: expected a whole number from 1 to {2**63 // SEED_STRIDE - 1}")
    return Plan(path, tuple(overrides), seed, runs, distributions, sweep_rows, design)


def _random_bits(seed: int, run: int, key: str) -> int:
    """Return 64 random bits, a pure function of the arguments."""
    text = "\0".join((str(seed), str(run), key))
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=8).digest(), "little")


def _random_unit(seed: int, run: int, key: str) -> float:
    """Return a number in (0, 1). See `_random_bits`."""
    return ((_random_bits(seed, run, key) >> 12) + 0.5) * 2.0**-52


def _independent(plan: Plan, run: int) -> list[float]:
    return [_random_unit(plan.seed, run, key) for key, _ in plan.vary]


def _grid(plan: Plan, run: int) -> list[float]:
    """Return the run's combination of the keys with finitely many values; other keys are independent."""
    quantiles = _independent(plan, run)
    for k, (_, distribution) in reversed(list(enumerate(plan.vary))):
        if n := len(distribution.values):
            run, quantile = divmod(run, n)
            quantiles[k] = (quantile + 0.5) / n
    return quantiles


@cache
def _latin(seed: int, runs: int, keys: tuple[str, ...]) -> np.ndarray:
    """Return a Latin hypercube of all runs, shape (keys, runs): each of n intervals of a key is drawn once."""
    ranks = [[_random_unit(seed, run, key) for run in range(runs)] for key in keys]
    offsets = [[_random_unit(seed, run, f"{key} inside") for run in range(runs)] for key in keys]
    return (np.argsort(np.argsort(ranks, axis=1), axis=1) + np.array(offsets)) / runs


@cache
def _sobol(seed: int, runs: int, keys: int) -> np.ndarray:
    """Return a scrambled Sobol sequence of all runs, shape (keys, runs)."""
    from scipy.stats.qmc import Sobol  # half a second to import

    points = Sobol(keys, rng=np.random.default_rng(_random_bits(seed, 0, "sobol")))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of balance at powers of two, which is not required
        return points.random(runs).T.clip(1e-12, 1.0 - 1e-12)


_DESIGNS: dict[str, Callable[[Plan, int], Iterable[float]]] = {
    "random": _independent,
    "lhs": lambda plan, run: _latin(plan.seed, plan.runs, tuple(key for key, _ in plan.vary))[:, run].tolist(),
    "sobol": lambda plan, run: _sobol(plan.seed, plan.runs, len(plan.vary))[:, run].tolist(),
    "grid": _grid,
}


def _read_sweep(path: Path) -> tuple[dict[str, Any], ...]:
    """Return the lines of a CSV file as values by key.

    Raises:
        ValueError: the file cannot be read, is empty, or has lines of different length.
    """
    try:
        lines = list(csv.reader(io.StringIO(read_text(path, "utf-8-sig")), skipinitialspace=True))
    except (OSError, UnicodeDecodeError) as fault:
        raise unreadable(f"sweep {path}", fault, "a table of scene keys (.csv)") from None
    keys, *rows = [[cell.strip() for cell in line] for line in lines if line] or [[]]
    if len(keys) == 1 and ";" in keys[0]:
        raise ValueError(f"sweep {path}: columns are separated by semicolons; expected commas")
    if not keys or not rows or len(set(keys)) != len(keys):
        raise ValueError(f"sweep {path}: expected a header of distinct keys, and a line of values for each run")
    for number, row in enumerate(rows, 2):
        if len(row) != len(keys):
            raise ValueError(f"sweep {path}: line {number}: expected {len(keys)} values, got {len(row)}")
    try:
        return tuple(dict(zip(keys, map(value_of, row), strict=True)) for row in rows)
    except ValueError as fault:
        raise ValueError(f"sweep {path}: {fault}") from None
