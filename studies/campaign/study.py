"""Many flights of one scene, each with another seed."""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from cosim.scene import Scene
from services.common.sections import Published
from services.table import reseed
from studies.campaign.figures import Figures, figures
from studies.campaign.setup import TOPICS, campaign_setup
from studies.fly import fly
from studies.tracking import AXES
from studies.verdict import KINDS


class Spread(NamedTuple):
    """How a figure is distributed over the seeds."""

    median: float
    low: float  # 5 % of the flights are below
    high: float  # 5 % are above
    worst: float
    seed: int  # of the worst


class Campaign(NamedTuple):
    """What has been flown, and what it came to."""

    scene: str
    source: str  # of the published figures
    published: dict[str, float]
    flights: list[Figures]
    rmse: dict[str, Spread]
    rmse_estimate: dict[str, Spread]
    inside: dict[str, Spread]  # x, y, z; the worst is the least
    failed: list[Figures]  # that did not land

    @property
    def counts(self) -> str:
        """How many flights ended how: "97 landed, 3 crashed"."""
        kinds = [f.verdict.kind for f in self.flights]
        return ", ".join(f"{kinds.count(kind)} {kind}" for kind in KINDS if kind in kinds)


def campaign(scene: Scene, seeds: Iterable[int], progress: Callable[[], None]) -> Campaign:
    """Fly the scene with each of the seeds, as many at once as there are processors.

    Args:
        scene: what to fly; its own seed is not used.
        seeds: one flight for each.
        progress: called after every flight.

    Raises:
        ValueError: nobody flies along a trajectory in this scene.
    """
    setup = campaign_setup(scene)

    def one(seed: int) -> Figures:
        found = figures(seed, fly(reseed(setup, seed), TOPICS))
        progress()
        return found

    first, *others = seeds
    flights = [one(first)]  # alone: it compiles
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        try:
            flights += pool.map(one, others)
        except BaseException:
            pool.shutdown(cancel_futures=True)  # Ctrl-C ends with the flights that are in the air
            raise
    return summary(scene, flights)


def summary(scene: Scene, flights: list[Figures]) -> Campaign:
    """The distribution of every figure over the flights."""
    published = scene[Published]

    def over(name: str) -> dict[str, Spread]:
        return {axis: spread([(getattr(f, name)[axis], f.seed) for f in flights]) for axis in AXES}

    return Campaign(
        scene.name,
        published.source,
        {str(axis): value for axis, value in published.rmse.items()},
        flights,
        over("rmse"),
        over("rmse_estimate"),
        {axis: spread([(f.inside[i], f.seed) for f in flights], least=True) for i, axis in enumerate("xyz")},
        [f for f in flights if f.failed],
    )


def spread(values: list[tuple[float, int]], least: bool = False) -> Spread:
    """Distribution of (value, seed); the worst is the greatest, or the `least`."""
    numbers = np.array([value for value, _ in values])
    median, low, high = np.quantile(numbers, [0.5, 0.05, 0.95])
    worst, seed = (min if least else max)(values)
    return Spread(float(median), float(low), float(high), worst, seed)
