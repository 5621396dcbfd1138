"""The plan of a campaign: which scene, how many runs, and what varies from run to run.

What a run draws depends on the campaign's seed, the run's number and the key alone, so that neither the order of the
runs nor who flies them changes anything. Where a design lays the runs out together, it depends on their count as well.
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
from lapwing.dynamics.input_file import read_text
from lapwing.studies.campaign.distributions import Distribution

APART = 2**32  # seeds of two campaigns
SEED = "run.seed"
MOST = 10_000_000  # runs of a campaign


class Plan(NamedTuple):
    """Plan of a campaign: scene, runs and what varies."""

    path: str  # of the scene, or its name
    overrides: tuple[str, ...]
    seed: int
    runs: int
    vary: tuple[tuple[str, Distribution], ...]  # by key, sorted
    sweep: tuple[dict[str, Any], ...] = ()  # values by key; run k takes entry k, from the start again after the last
    design: str = "random"  # of _PLACES

    @property
    def keys(self) -> list[str]:
        """The keys that vary."""
        return [*(key for key, _ in self.vary), *(self.sweep[0] if self.sweep else ())]

    def option(self, key: str) -> str:
        """Return the command-line option that varies a key; "" if there is none."""
        if any(key == varied for varied, _ in self.vary):
            return "--vary"
        return "--sweep: column" if key in self.keys else ""

    def seed_of(self, run: int) -> int:
        """Return the seed of a run: 1, 2, ... of campaign 1; no two campaigns share a seed."""
        return (self.seed - 1) * APART + run + 1

    def anywhere(self) -> "Plan":
        """Return the plan with absolute paths, for workers with another working directory."""
        path = Path(self.path)
        return self._replace(path=str(path.absolute())) if path.is_file() else self

    def values(self, run: int) -> dict[str, Any]:
        """Return the drawn values of a run by key."""
        places = _PLACES[self.design](self, run)
        drawn = {key: distribution.at(u) for (key, distribution), u in zip(self.vary, places, strict=True)}
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
        overrides: KEY=VALUE of every run.
        runs: number of runs; by default the entries of the sweep, the points of the grid, or 100.
        seed: seed of the campaign.
        vary: distribution by key.
        sweep: CSV file with a column per key and a line per run, for correlated values.
        design: sampling of the varied keys: independent, Latin hypercube, scrambled Sobol sequence, or a grid of all
            combinations of finitely many values.

    Raises:
        ValueError: an argument is invalid.
    """
    varied, swept = tuple(sorted((vary or {}).items())), _read(sweep) if sweep else ()
    if both := sorted(set(vary or {}) & set(swept[0] if swept else ())):
        raise ValueError(f"--vary {both[0]}: the sweep {sweep} varies it, too")
    overrides = tuple(overrides)
    fixed = "--set" if any(text.partition("=")[0].strip() == SEED for text in overrides) else ""
    if option := Plan(path, (), seed, 1, varied, swept).option(SEED) or fixed:
        raise ValueError(f"{option} {SEED}: every run has a seed of its own; expected --seed")
    if design not in _PLACES:
        raise ValueError(f"--design {design}: expected one of {', '.join(_PLACES)}")
    if design in ("lhs", "sobol") and not varied:
        raise ValueError(f"--design {design}: expected a --vary")
    points = math.prod(len(d.values) for _, d in varied if d.values)
    if design == "grid" and not any(d.values for _, d in varied):
        raise ValueError("--design grid: expected a --vary with choice(...) or linspace(...)")
    if runs is None:
        runs = len(swept) or (points if design == "grid" else 100)
    if not 1 <= runs <= MOST:
        raise ValueError(f"--runs {runs}: expected a number from 1 to {MOST}")
    if not 1 <= seed < 2**63 // APART:
        raise ValueError(f"--seed {seed}: expected a whole number from 1 to {2**63 // APART - 1}")
    return Plan(path, overrides, seed, runs, varied, swept, design)


def _word(seed: int, run: int, key: str) -> int:
    """Return 64 random bits, a pure function of the arguments."""
    text = "\0".join((str(seed), str(run), key))
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=8).digest(), "little")


def _unit(seed: int, run: int, key: str) -> float:
    """Return a number in (0, 1). See `_word`."""
    return ((_word(seed, run, key) >> 12) + 0.5) * 2.0**-52


def _independent(plan: Plan, run: int) -> list[float]:
    return [_unit(plan.seed, run, key) for key, _ in plan.vary]


def _grid(plan: Plan, run: int) -> list[float]:
    """Return the run's combination of the keys with finitely many values; other keys are independent."""
    places = _independent(plan, run)
    for k, (_, distribution) in reversed(list(enumerate(plan.vary))):
        if n := len(distribution.values):
            run, place = divmod(run, n)
            places[k] = (place + 0.5) / n
    return places


@cache
def _latin(seed: int, runs: int, keys: tuple[str, ...]) -> np.ndarray:
    """Return a Latin hypercube of all runs, shape (keys, runs): each n-th part of a key's range is drawn once."""
    ranked = [[_unit(seed, run, key) for run in range(runs)] for key in keys]
    inside = [[_unit(seed, run, f"{key} inside") for run in range(runs)] for key in keys]
    return (np.argsort(np.argsort(ranked, axis=1), axis=1) + np.array(inside)) / runs


@cache
def _sobol(seed: int, runs: int, keys: int) -> np.ndarray:
    """Return a scrambled Sobol sequence of all runs, shape (keys, runs)."""
    from scipy.stats.qmc import Sobol  # half a second to import

    points = Sobol(keys, rng=np.random.default_rng(_word(seed, 0, "sobol")))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # it is balanced at powers of two, which nobody need fly
        return points.random(runs).T.clip(1e-12, 1.0 - 1e-12)


_PLACES: dict[str, Callable[[Plan, int], Iterable[float]]] = {
    "random": _independent,
    "lhs": lambda plan, run: _latin(plan.seed, plan.runs, tuple(key for key, _ in plan.vary))[:, run].tolist(),
    "sobol": lambda plan, run: _sobol(plan.seed, plan.runs, len(plan.vary))[:, run].tolist(),
    "grid": _grid,
}


def _read(path: Path) -> tuple[dict[str, Any], ...]:
    """Return the lines of a CSV file as values by key.

    Raises:
        ValueError: it cannot be read, has no lines, or lines of different length.
    """
    try:
        lines = list(csv.reader(io.StringIO(read_text(path, "utf-8-sig")), skipinitialspace=True))
    except (OSError, UnicodeDecodeError) as fault:
        raise ValueError(f"--sweep {path}: cannot be read: {getattr(fault, 'strerror', None) or fault}") from None
    keys, *rows = [[cell.strip() for cell in line] for line in lines if line] or [[]]
    if len(keys) == 1 and ";" in keys[0]:
        raise ValueError(f"--sweep {path}: columns are separated by semicolons; expected commas")
    if not keys or not rows or len(set(keys)) != len(keys):
        raise ValueError(f"--sweep {path}: expected a line of keys, each once, and a line of values for each run")
    for number, row in enumerate(rows, 2):
        if len(row) != len(keys):
            raise ValueError(f"--sweep {path}: line {number}: expected {len(keys)} values, got {len(row)}")
    try:
        return tuple(dict(zip(keys, map(value_of, row), strict=True)) for row in rows)
    except ValueError as fault:
        raise ValueError(f"--sweep {path}: {fault}") from None
