"""Bandwidths polished on the non-linear closed loop: the least error of the scene's flight that keeps the margins."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize

from lapwing.cosim.scene import Scene
from lapwing.services.autopilot.controller_parameters import Airframe, build
from lapwing.services.autopilot.gains import GainSet
from lapwing.services.autopilot.margins import open_loops
from lapwing.services.scene_resolver import reseed
from lapwing.studies.campaign.campaign_config import campaign_setup
from lapwing.studies.tracking import AXES
from lapwing.studies.tune.bandwidths import Bandwidths
from lapwing.studies.tune.corners import metrics_of, with_gains
from lapwing.studies.tune.design import DELAY, assumed_airframe, gain_set, shortfalls
from lapwing.studies.tune.linearise import Hover

Figures = dict[str, Any]  # by name, of `lapwing.studies.metrics`

CANDIDATES = 60  # at most
FIRST_STEP = 0.1  # of the logarithm of every bandwidth
FINE = 2e-3  # of the same, and of the error, at which the search ends
SEEDS = 3  # flights of each candidate, so that nothing is tuned to one draw of the noise
MOVED_BY = {
    "altitude": ("z",),
    "yaw": ("yaw",),
    "attitude": ("x", "y"),
    "position": ("x", "y"),
}  # what judges a bandwidth
AT_ALL = 1e-6  # [m], [rad]: an axis that errs less, since nothing moves it, is not judged


class Refinement(NamedTuple):
    """Result of the search."""

    gains: GainSet
    bandwidths: Bandwidths
    before: list[Figures]  # of the scene's flight with some seeds, with the gains that it began with
    after: list[Figures]
    candidates: int  # that kept their margins and were flown


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
    plant, setup = assumed_airframe(airframe, model), campaign_setup(scene)
    tried: dict[float, tuple[Bandwidths, GainSet, list[Figures]]] = {}

    def fly(gains: GainSet) -> list[Figures]:
        progress()
        run = with_gains(setup, gains)
        return [metrics_of(reseed(run, setup.seed + k)) for k in range(SEEDS)]

    before = fly(gain_set(model, start))
    judged = [axis for axis in AXES if rmse(before, axis) > AT_ALL]

    free = [name for name, axes in MOVED_BY.items() if set(axes) & set(judged)]

    def cost(logarithms: np.ndarray) -> float:
        bandwidths = start._replace(**{n: float(b) for n, b in zip(free, np.exp(logarithms), strict=True)})
        gains = gain_set(model, bandwidths)
        lacking = shortfalls(open_loops(build(gains.plain(), airframe), plant, tick, DELAY))
        if lacking:
            return 10.0 + len(lacking)
        result = fly(gains)
        if any(f["outcome"] != "landed" for f in result):
            return 10.0
        ratio = float(np.mean([rmse(result, axis) / rmse(before, axis) for axis in judged]))
        tried[ratio] = bandwidths, gains, result
        return ratio

    if not free:
        return Refinement(gain_set(model, start), start, before, before, 0)
    at = np.log([getattr(start, name) for name in free])
    simplex = np.vstack([at, at + FIRST_STEP * np.eye(len(at))])
    options = {"maxfev": CANDIDATES, "xatol": FINE, "fatol": FINE, "initial_simplex": simplex}
    minimize(cost, at, method="Nelder-Mead", options=options)
    if not tried:
        what = next(
            (f["outcome_text"] for f in before if f["outcome"] != "landed"),
            "none of those near it holds its margins and lands",
        )
        raise ValueError(f"no gain set lands this flight; as designed: {what}; ask for other bandwidths")
    bandwidths, gains, after = tried[min(tried)]
    return Refinement(gains, bandwidths, before, after, len(tried))


def rmse(flights: list[Figures], axis: str) -> float:
    """Return the root-mean-square error of an axis over several flights [m] or [rad]."""
    return float(np.sqrt(np.mean([f[f"rmse.{axis}"] ** 2 for f in flights])))
