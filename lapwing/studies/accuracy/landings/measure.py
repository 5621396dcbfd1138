"""Errors of random landings relative to their accuracy."""

import json
import os
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lapwing.cosim.complete_file import complete_file
from lapwing.studies.accuracy.landings import cases
from lapwing.studies.json_file import write_json
from lapwing.studies.workers import workers


class LandingErrors(NamedTuple):
    """Errors of one landing at several accuracies."""

    seed: int
    events: int  # located by the reference
    error: tuple[float, ...]  # largest error over time, for each of `cases.ACCURACIES`
    worst_time: tuple[float, ...]  # [s] time of each error
    seconds: tuple[float, ...]  # [s] wall time of each flight
    round_off: float  # difference by the last bit of the initial state


def fly_and_compare(kind: str, seed: int) -> LandingErrors:
    """Fly a landing at every accuracy and compare the entire state with the reference at all times."""
    case = cases.DRAWS[kind](seed)
    exact, events = cases.exact(case)
    error, worst_time, times = [], [], []
    for accuracy in cases.ACCURACIES:
        states, seconds = cases.fly(case, accuracy)
        errors = cases.errors(states, exact)
        error.append(float(errors.max()))
        worst_time.append(float(cases.times()[errors.argmax()]))
        times.append(seconds)
    return LandingErrors(seed, events, tuple(error), tuple(worst_time), tuple(times), cases.round_off(case))


def measure(seeds: Iterable[int], processes: int | None = None, kind: str = "random") -> Iterator[LandingErrors]:
    """Yield measured landings of a kind in `cases.DRAWS` in the order of their seeds; by default on all processors."""
    remaining = list(seeds)
    if remaining:
        with workers(max(1, min(len(remaining), processes or os.cpu_count() or 1))) as pool:
            yield from pool.map(partial(fly_and_compare, kind), remaining)


def read(path: Path) -> dict[int, LandingErrors]:
    """Return the landings of a file of `write` by their seeds; none if the file does not exist."""
    rows: list[dict[str, Any]] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else []
    values: list[dict[str, Any]] = [{k: tuple(v) if isinstance(v, list) else v for k, v in row.items()} for row in rows]
    return {row["seed"]: LandingErrors(**row) for row in values}


def write(path: Path, landings: Iterable[LandingErrors]) -> None:
    """Write landings as JSON in the order of their seeds."""
    with complete_file(path) as file:
        write_json(file, sorted(landings))


def ratios(landings: Iterable[LandingErrors]) -> np.ndarray:
    """Return errors over accuracies, shape (landings, accuracies)."""
    return np.array([landing.error for landing in landings]) / np.array(cases.ACCURACIES)
