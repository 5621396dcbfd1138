"""Refinement of bandwidths in simulated flights: smallest tracking error with the required margins."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize

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

CANDIDATES = 60  # largest number of gain sets
FIRST_STEP = 0.1  # initial step of the logarithm of every bandwidth
SEARCH_TOLERANCE = 2e-3  # step and relative error at the end of the search
SEEDS = 3  # flights of each candidate, to average over the noise
# Axes whose errors judge a bandwidth.
JUDGING_AXES = {"altitude": ("z",), "yaw": ("yaw",), "attitude": ("x", "y"), "position": ("x", "y")}
MIN_RMSE = 1e-6  # [m], [rad] axes with smaller errors are not excited and not judged


class Refinement(NamedTuple):
    """Result of the refinement."""

    gains: GainSet
    bandwidths: Bandwidths
    before: list[Figures]  # metrics of the flights with the initial gains, one per seed
    after: list[Figures]  # metrics with the refined gains
    candidates: int  # number of gain sets with the margins, which were flown


def refine(
    scene: Scene,
    model: Hover,
    airframe: Airframe,
    tick: float,
    start: Bandwidths,
    progress: Callable[[], None] = lambda: None,
) -> Refinement:
    """Refine the bandwidths that the scene's path excites by Nelder and Mead's search, from `start`.

    The objective is the mean over the axes of the RMSE over that of `start`. A gain set that does not land or lacks a
    margin is worse than any that flies. Deterministic: equal scenes return equal gains.
    """
    plant, config = assumed_airframe(airframe, model), campaign_config(scene)
    valid: dict[float, tuple[Bandwidths, GainSet, list[Figures]]] = {}

    def fly(gains: GainSet) -> list[Figures]:
        progress()
        run = with_gains(config, gains)
        return [metrics_of(reseed(run, config.seed + k)) for k in range(SEEDS)]

    before = fly(gain_set(model, start))
    judged_axes = [axis for axis in AXES if rmse(before, axis) > MIN_RMSE]

    free_bandwidths = [name for name, axes in JUDGING_AXES.items() if set(axes) & set(judged_axes)]

    def cost(logarithms: np.ndarray) -> float:
        bandwidths = start._replace(**{n: float(b) for n, b in zip(free_bandwidths, np.exp(logarithms), strict=True)})
        gains = gain_set(model, bandwidths)
        missing = shortfalls(open_loops(build(gains.plain(), airframe), plant, tick, DELAY))
        if missing:
            return 10.0 + len(missing)
        result = fly(gains)
        if any(f["outcome"] != "landed" for f in result):
            return 10.0
        ratio = float(np.mean([rmse(result, axis) / rmse(before, axis) for axis in judged_axes]))
        valid[ratio] = bandwidths, gains, result
        return ratio

    if not free_bandwidths:
        return Refinement(gain_set(model, start), start, before, before, 0)
    at = np.log([getattr(start, name) for name in free_bandwidths])
    simplex = np.vstack([at, at + FIRST_STEP * np.eye(len(at))])
    options = {"maxfev": CANDIDATES, "xatol": SEARCH_TOLERANCE, "fatol": SEARCH_TOLERANCE, "initial_simplex": simplex}
    minimize(cost, at, method="Nelder-Mead", options=options)
    if not valid:
        reason = next(
            (f["outcome_text"] for f in before if f["outcome"] != "landed"),
            "no gain set nearby has the margins and lands",
        )
        raise ValueError(f"no gain set completes this flight; designed gains: {reason}; use other bandwidths")
    bandwidths, gains, after = valid[min(valid)]
    return Refinement(gains, bandwidths, before, after, len(valid))


def rmse(flights: list[Figures], axis: str) -> float:
    """Return the root-mean-square error of an axis over several flights [m] or [rad]."""
    return float(np.sqrt(np.mean([f[f"rmse.{axis}"] ** 2 for f in flights])))
