"""Minimum separation of the vehicles of a fleet."""

from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import NamedTuple

import numpy as np

from lapwing.flights.topic_view import TopicView


class Separation(NamedTuple):
    """Minimum distance between the centres of mass of two vehicles, and its time."""

    distance: float  # [m]
    time: float  # [s]
    vehicles: tuple[str, str]

    def __str__(self) -> str:
        """Return the separation as a sentence without its full stop."""
        return f"Nearest: {' and '.join(self.vehicles)}, {self.distance:.2f} m apart at {self.time:.2f} s"


def distances(truths: Mapping[str, TopicView]) -> Iterator[tuple[tuple[str, str], np.ndarray]]:
    """Yield each pair of vehicles with their separation [m] over their common time, shape (n,)."""
    for (a, x), (b, y) in combinations(truths.items(), 2):
        n = min(len(x), len(y))
        yield (a, b), np.linalg.norm(x.position[:n] - y.position[:n], axis=1)


def nearest(truths: Mapping[str, TopicView]) -> Separation:
    """Return the minimum separation of at least two vehicles, by their true states."""
    result = []
    for pair, distance in distances(truths):
        k = int(np.argmin(distance))
        result.append(Separation(float(distance[k]), float(truths[pair[0]].times[k]), pair))
    return min(result)


def least_over_time(truths: Mapping[str, TopicView]) -> np.ndarray:
    """Return the minimum separation [m] of any pair at each time common to all vehicles, shape (n,)."""
    n = min(len(truth) for truth in truths.values())
    least = np.full(n, np.inf)
    for _, distance in distances(truths):
        np.minimum(least, distance[:n], out=least)
    return least
