"""Asked against got over many random landings."""

import os
from typing import NamedTuple

import numpy as np

from lapwing.studies.accuracy.landings import cases
from lapwing.studies.workers import workers


class LandingErrors(NamedTuple):
    """One landing."""

    seed: int
    events: int  # located by the reference
    got: tuple[float, ...]  # largest error over all moments, for each of `cases.ACCURACIES`
    worst: tuple[float, ...]  # [s] the moment of each
    seconds: tuple[float, ...]  # wall time of each


def measured(seed: int) -> LandingErrors:
    """Fly a landing at every accuracy and compare its whole state, at every moment, with the reference."""
    case = cases.draw(seed)
    exact, events = cases.exact(case)
    got, worst, taken = [], [], []
    for accuracy in cases.ACCURACIES:
        states, seconds = cases.flown(case, accuracy)
        errors = cases.errors(states, exact)
        got.append(float(errors.max()))
        worst.append(float(cases.times()[errors.argmax()]))
        taken.append(seconds)
    return LandingErrors(seed, events, tuple(got), tuple(worst), tuple(taken))


def measure(count: int) -> list[LandingErrors]:
    """Measure landings 0 to before `count` on all processors."""
    with workers(max(1, min(count, os.cpu_count() or 1))) as pool:
        return list(pool.map(measured, range(count)))


def ratios(found: list[LandingErrors]) -> np.ndarray:
    """Return error got over error asked, shape (landings, accuracies)."""
    return np.array([landing.got for landing in found]) / np.array(cases.ACCURACIES)
