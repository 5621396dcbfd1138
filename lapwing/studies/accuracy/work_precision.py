"""Running every way of a problem from coarse to fine: error, wall time, evaluations, drift."""

import math
import statistics
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from lapwing.dynamics.config_error import ConfigError
from lapwing.studies.accuracy.coordinates import error
from lapwing.studies.accuracy.problem import Problem, SolverMethod, SolverRun

FINE_ENOUGH = 1e-11  # errors below are round-off, of the run or of the reference
LONGEST = 0.1  # [s] of wall time of one run; what takes longer is not repeated, and not refined by default
TIMED = 0.02  # [s] spent on timing a run
REPEATS = (3, 500)  # fewest and most


class Point(NamedTuple):
    """One way at one setting."""

    way: str
    order: int
    unit: str
    setting: float
    error: float  # largest difference to the reference at the end, relative to 1 + size
    time: float  # [s] of wall time, median
    evaluations: int | None
    drift: dict[str, float]  # of each invariant, relative to its size; "manifold": how far the end is off it


def measure(problem: Problem, longest: float = LONGEST) -> list[Point]:
    """Return all points of a problem, method by method, each from coarse to fine until a run takes `longest` [s]."""
    exact = problem.reference()
    points = []
    for way in problem.ways:
        way.idle()  # compiles or loads
        points += _refine(problem, way, exact, longest)
    return points


def _refine(problem: Problem, way: SolverMethod, exact: np.ndarray, longest: float) -> list[Point]:
    points: list[Point] = []
    idle = clock(way.idle)[0]
    for setting in way.settings:
        seconds, result = clock(way.prepare(setting))
        outcome = way.read(setting, result)
        if outcome is not None and np.isfinite(outcome.samples).all():
            off = error(outcome.samples[-1], exact)
            net = max(seconds - idle, 1e-7)
            drifts = drift(problem, outcome)
            points.append(Point(way.name, way.order, way.unit, setting, off, net, outcome.evaluations, drifts))
        if seconds > longest or _refinement_is_useless([p.error for p in points]):
            break
    return points


def _refinement_is_useless(errors: list[float]) -> bool:
    """Return True if further refinement is useless."""
    if not errors:
        return False
    best = min(errors)
    return best < FINE_ENOUGH or (best < 1e-8 and len(errors) > 2 and best < min(errors[-2:]))


def drift(problem: Problem, outcome: SolverRun) -> dict[str, float]:
    """Return the largest change of each invariant over the samples, relative to its size at the start."""
    result = {"manifold": outcome.defect}
    for name, invariant in problem.invariants.items():
        values = invariant(outcome.times, outcome.samples)
        size = np.abs(values[0]).max()
        result[name] = float(np.abs(values - values[0]).max() / (size if size > 0.0 else 1.0))
    return result


def clock(work: Callable[[], Any]) -> tuple[float, Any]:
    """Return (median wall time [s], result) of a call."""
    times: list[float] = []
    while len(times) < REPEATS[0] or (sum(times) < TIMED and len(times) < REPEATS[1]):
        started = time.perf_counter()
        result = work()
        times.append(time.perf_counter() - started)
        if times[-1] > LONGEST:
            break
    return statistics.median(times), result


def cheapest(points: list[Point], target: float) -> Point:
    """Return the fastest point whose error is at most `target`.

    Raises:
        ConfigError: there is none.
    """
    met = [p for p in points if p.error <= target]
    if not met:
        best = min(points, key=lambda p: p.error, default=None)
        reached = f"; the smallest reached is {best.error:.2g}, by {best.way}" if best else ""
        raise ConfigError(f"--target {target:g}", f"no method meets this error{reached}")
    return min(met, key=lambda p: p.time)


def pareto_points(points: list[Point], levels: list[float]) -> list[Point]:
    """Return the fastest point of each method at each of these errors."""
    selected: list[Point] = []
    for way in dict.fromkeys(p.way for p in points):
        own = [p for p in points if p.way == way]
        for level in levels:
            met = [p for p in own if p.error <= level]
            if met and (result := min(met, key=lambda p: p.time)) not in selected:
                selected.append(result)
    return selected


def check_target(target: float | None) -> None:
    """Check that a target is a valid error.

    Raises:
        ValueError: it is zero, negative or no number.
    """
    if target is not None and not (target > 0.0 and math.isfinite(target)):
        raise ValueError(f"--target {target:g}: expected an error above 0, for example 1e-6")
