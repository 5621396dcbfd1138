"""Refinement of bandwidths in simulated flights: smallest tracking error with the required margins."""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from lapwing.cosim.scene import Scene
from lapwing.flights.tracking import AXES
from lapwing.services.autopilot.controller_parameters import Airframe, build
from lapwing.services.autopilot.gains import GainSet
from lapwing.services.autopilot.margins import open_loops
from lapwing.services.scene_resolver import reseed
from lapwing.studies.campaign.campaign_config import campaign_config
from lapwing.studies.tune.bandwidths import Bandwidths
from lapwing.studies.tune.corners import metrics_of, with_gains
from lapwing.studies.tune.design import DELAY, assumed_airframe, gain_set, shortfalls
from lapwing.studies.tune.linearise import Hover

Figures = dict[str, Any]  # metrics by name, see `lapwing.flights.metrics`

GAIN_SETS = 24  # largest number that is flown
FIRST_STEP, LAST_STEP = 0.1, 0.005  # of the logarithm of a bandwidth
SEEDS = 3  # flights of each gain set, to average over the noise
# Bandwidths of each search, the axes of which one must be excited, and others that judge them too.
SEARCHES = (
    (("altitude",), ("z",), ()),
    (("yaw",), ("yaw",), ()),
    (("attitude", "position"), ("x", "y"), ("roll", "pitch")),
)
MIN_RMSE = 1e-6  # [m], [rad] axes with smaller errors are not excited and not judged


class Refinement(NamedTuple):
    """Result of the refinement."""

    gains: GainSet
    bandwidths: Bandwidths
    before: list[Figures]  # metrics of the flights with the initial gains, one per seed
    after: list[Figures]  # metrics with the refined gains
    gain_sets: int  # number of gain sets flown


class _Search:
    """Pattern search over the logarithms of the bandwidths of some loops: a step of one of them at a time."""

    def __init__(self, loops: tuple[str, ...], axes: tuple[str, ...], cost: float):
        self.axes = axes
        self._moves = [(loop, sign) for loop in loops for sign in (1.0, -1.0)]
        self._step, self._failed, self._cost = FIRST_STEP, 0, cost

    def step(self, at: Bandwidths, is_valid: Callable[[Bandwidths], bool]) -> dict[str, float]:
        """Return the next valid step from `at`: the changed bandwidth by name; empty at the end of the search."""
        while self._step >= LAST_STEP:
            for _ in range(len(self._moves) - self._failed):
                loop, sign = self._moves[0]
                change = {loop: getattr(at, loop) * math.exp(sign * self._step)}
                if is_valid(at._replace(**change)):
                    return change
                self._reject()
            self._step, self._failed = 0.5 * self._step, 0
        return {}

    def accepts(self, cost: float) -> bool:
        """Return True if the step reduces the cost. The way back needs no trial then."""
        if not cost < self._cost:
            self._reject()
            return False
        loop, sign = self._moves[0]
        self._moves.remove((loop, -sign))
        self._moves.append((loop, -sign))
        self._cost, self._failed = cost, 1
        return True

    def _reject(self) -> None:
        self._moves.append(self._moves.pop(0))
        self._failed += 1


def refine(
    scene: Scene,
    model: Hover,
    airframe: Airframe,
    tick: float,
    start: Bandwidths,
    progress: Callable[[], None] = lambda: None,
) -> Refinement:
    """Refine the bandwidths that the scene's path excites by pattern searches from `start`.

    A loop has its own axes and margins, so each flight tests a step of altitude, one of yaw, and one of the cascade at
    once, and each is judged by its own axes: the mean of their RMSE over that of `start`. The best of all gain sets
    flown is the result, by the mean over all axes; a gain set that does not land is none, one that lacks a margin is
    not flown. Deterministic: equal scenes return equal gains.

    Raises:
        ValueError: no gain set lands.
    """
    plant, config = assumed_airframe(airframe, model), campaign_config(scene)
    flown: dict[Bandwidths, list[Figures]] = {}

    def fly(bandwidths: Bandwidths) -> list[Figures]:
        if bandwidths not in flown:
            progress()
            run = with_gains(config, gain_set(model, bandwidths))
            flown[bandwidths] = [metrics_of(reseed(run, config.seed + k)) for k in range(SEEDS)]
        return flown[bandwidths]

    def has_margins(bandwidths: Bandwidths) -> bool:
        return not shortfalls(open_loops(build(gain_set(model, bandwidths).plain(), airframe), plant, tick, DELAY))

    def cost(flights: list[Figures], axes: Sequence[str]) -> float:
        if any(f["outcome"] != "landed" for f in flights):
            return math.inf
        return float(np.mean([rmse(flights, axis) / rmse(before, axis) for axis in axes]))

    before = fly(start)
    judged = [axis for axis in AXES if rmse(before, axis) > MIN_RMSE]
    searches = []
    for loops, excited, others in SEARCHES:
        if set(excited) & set(judged):
            axes = tuple(axis for axis in (*excited, *others) if axis in judged)
            searches.append(_Search(loops, axes, cost(before, axes)))
    if not searches:
        return Refinement(gain_set(model, start), start, before, before, 0)
    at = start
    while len(flown) < GAIN_SETS - 1:
        steps = [(search, step) for search in searches if (step := search.step(at, has_margins))]
        if not steps:
            break
        flights = fly(at._replace(**{name: value for _, step in steps for name, value in step.items()}))
        for search, step in steps:
            if search.accepts(cost(flights, search.axes)):
                at = at._replace(**step)
    fly(at)
    best = min(flown, key=lambda bandwidths: cost(flown[bandwidths], judged))
    if math.isinf(cost(flown[best], judged)):
        reason = next(f["outcome_text"] for f in before if f["outcome"] != "landed")
        raise ValueError(f"no gain set completes this flight; designed gains: {reason}; use other bandwidths")
    return Refinement(gain_set(model, best), best, before, flown[best], len(flown))


def rmse(flights: list[Figures], axis: str) -> float:
    """Return the root-mean-square error of an axis over several flights [m] or [rad]."""
    return float(np.sqrt(np.mean([f[f"rmse.{axis}"] ** 2 for f in flights])))
