"""Measurement of all methods of a problem from coarse to fine: error, wall time, evaluations, drift."""

import math
import statistics
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from lapwing.dynamics.config_error import ConfigError
from lapwing.studies.accuracy.coordinates import error
from lapwing.studies.accuracy.problem import Problem, SolverMethod, SolverRun

FINE_ENOUGH = 1e-11  # smaller errors are round-off of the run or of the reference
LONGEST = 0.1  # [s] wall time of one run, above which it is neither repeated nor refined
TIMED = 0.02  # [s] total time of the repetitions
REPEATS = (3, 500)  # limits of the number of repetitions


class Point(NamedTuple):
    """Result of one method at one setting."""

    method: str
    order: int
    unit: str
    setting: float
    error: float  # largest final difference from the reference, relative to 1 + size
    time: float  # [s] median wall time
    evaluations: int | None
    drift: dict[str, float]  # of each invariant, relative to its size; "manifold": distance of the final state


def measure(problem: Problem, longest: float = LONGEST) -> list[Point]:
    """Return all points of a problem, method by method, each from coarse to fine until a run takes `longest` [s]."""
    exact = problem.reference()
    points = []
    for method in problem.methods:
        method.idle()  # compiles or loads the kernels
        points += _refine(problem, method, exact, longest)
    return points


def _refine(problem: Problem, method: SolverMethod, exact: np.ndarray, longest: float) -> list[Point]:
    points: list[Point] = []
    idle = clock(method.idle)[0]
    for setting in method.settings:
        seconds, result = clock(method.prepare(setting))
        outcome = method.read(setting, result)
        if outcome is not None and np.isfinite(outcome.samples).all():
            measured = error(outcome.samples[-1], exact), max(seconds - idle, 1e-7), outcome.evaluations
            points.append(Point(method.name, method.order, method.unit, setting, *measured, drift(problem, outcome)))
        if seconds > longest or _refinement_is_useless([p.error for p in points]):
            break
    return points


def _refinement_is_useless(errors: list[float]) -> bool:
    """Return True if the last errors are round-off: small, or no longer decreasing.

    One small error does not count, because a long step can be under error control, and a finer one not.
    """
    if len(errors) < 2:
        return False
    last = errors[-3:]
    return max(last[-2:]) < FINE_ENOUGH or (len(last) > 2 and last == sorted(last) and last[0] < 1e-8)


def drift(problem: Problem, outcome: SolverRun) -> dict[str, float]:
    """Return the largest change of each invariant over the samples, relative to its initial size."""
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
        ConfigError: no point meets the target.
    """
    candidates = [p for p in points if p.error <= target]
    if not candidates:
        best = min(points, key=lambda p: p.error, default=None)
        reached = f"; the smallest error is {best.error:.2g}, by {best.method}" if best else ""
        raise ConfigError(f"--target {target:g}", f"no method meets this error{reached}")
    return min(candidates, key=lambda p: p.time)


def pareto_points(points: list[Point], levels: list[float]) -> list[Point]:
    """Return the fastest point of each method at each of these errors."""
    selected: list[Point] = []
    for method in dict.fromkeys(p.method for p in points):
        own = [p for p in points if p.method == method]
        for level in levels:
            candidates = [p for p in own if p.error <= level]
            if candidates and (result := min(candidates, key=lambda p: p.time)) not in selected:
                selected.append(result)
    return selected


def check_target(target: float | None) -> None:
    """Check that a target is a valid error.

    Raises:
        ValueError: the target is not a positive finite number.
    """
    if target is not None and not (target > 0.0 and math.isfinite(target)):
        raise ValueError(f"--target {target:g}: expected an error above 0, for example 1e-6")
