"""Asked against got over many random landings."""

import json
import os
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lapwing.studies.accuracy.landings import cases
from lapwing.studies.complete_file import complete_file
from lapwing.studies.json_file import write_json
from lapwing.studies.workers import workers


class LandingErrors(NamedTuple):
    """One landing."""

    seed: int
    events: int  # located by the reference
    got: tuple[float, ...]  # largest error over all moments, for each of `cases.ACCURACIES`
    worst: tuple[float, ...]  # [s] the moment of each
    seconds: tuple[float, ...]  # wall time of each
    round_off: float  # difference that the last bit of the start makes


def fly_and_compare(kind: str, seed: int) -> LandingErrors:
    """Fly a landing at every accuracy and compare its whole state, at every moment, with the reference."""
    case = cases.DRAWS[kind](seed)
    exact, events = cases.exact(case)
    got, worst, times = [], [], []
    for accuracy in cases.ACCURACIES:
        states, seconds = cases.fly(case, accuracy)
        errors = cases.errors(states, exact)
        got.append(float(errors.max()))
        worst.append(float(cases.times()[errors.argmax()]))
        times.append(seconds)
    return LandingErrors(seed, events, tuple(got), tuple(worst), tuple(times), cases.round_off(case))


def measure(seeds: Iterable[int], processes: int | None = None, kind: str = "random") -> Iterator[LandingErrors]:
    """Yield measured landings of a kind in `cases.DRAWS` in the order of their seeds; by default on all processors."""
    waiting = list(seeds)
    if waiting:
        with workers(max(1, min(len(waiting), processes or os.cpu_count() or 1))) as pool:
            yield from pool.map(partial(fly_and_compare, kind), waiting)


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
    """Return error got over error asked, shape (landings, accuracies)."""
    return np.array([landing.got for landing in landings]) / np.array(cases.ACCURACIES)
