"""Measurement of all methods of a problem from coarse to fine: error, evaluations, drift, and CPU time to display.

Limits and choices count evaluations of the right-hand side, so that they are equal on any machine under any load.
"""

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
MOST_EVALUATIONS = 2_000_000  # of one run, above which it is not refined
TIMED = 0.02  # [s] total time of the repetitions
REPEATS = (3, 500)  # limits of the number of repetitions
SHORTEST = 1e-7  # [s] of a displayed time


class Point(NamedTuple):
    """Result of one method at one setting."""

    method: str
    order: int
    unit: str
    setting: float
    error: float  # largest final difference from the reference, relative to 1 + size
    time: float  # [s] median CPU time of the thread, to display; NaN: not measured
    evaluations: int | None  # None: unknown
    drift: dict[str, float]  # of each invariant, relative to its size; "manifold": distance of the final state
    spread: tuple[float, float] = (math.nan, math.nan)  # [s] quartiles of the repetitions' CPU times

    @property
    def work(self) -> tuple[float, float, float]:
        """Key that orders points by their cost, without a clock: fewer evaluations, then coarser, then more exact."""
        return math.inf if self.evaluations is None else self.evaluations, -self.setting, self.error


def measure(
    problem: Problem,
    most: int = MOST_EVALUATIONS,
    timed: bool = True,
    progress: Callable[[str, int], None] = lambda name, done: None,
) -> list[Point]:
    """Return all points of a problem, method by method, each from coarse to fine.

    Args:
        problem: any problem.
        most: evaluations of a run after which its method is not refined.
        timed: measure the CPU time of each run.
        progress: called with the name of the next part and the number of finished methods.
    """
    progress("reference", 0)
    exact = problem.reference()
    points = []
    for done, method in enumerate(problem.methods):
        progress(method.name, done)
        method.idle()  # compiles or loads the kernels
        points += _refine(problem, method, exact, most, timed)
    return points


def _refine(problem: Problem, method: SolverMethod, exact: np.ndarray, most: int, timed: bool) -> list[Point]:
    points: list[Point] = []
    idle = _clock(method.idle)[1] if timed else 0.0
    for setting in method.settings:
        run = method.prepare(setting)
        outcome = method.read(setting, run())
        if outcome is not None and np.isfinite(outcome.samples).all():
            low, median, high = (max(t - idle, SHORTEST) for t in _clock(run)) if timed else (math.nan,) * 3
            final = error(outcome.samples[-1], exact)
            points.append(
                Point(
                    method.name, method.order, method.unit, setting, final, median, outcome.evaluations,
                    drift(problem, outcome), (low, high),
                )
            )  # fmt: skip
        done = outcome is not None and (outcome.evaluations or 0) > most
        if done or _refinement_is_useless([p.error for p in points]):
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


def _clock(work: Callable[[], Any]) -> list[float]:
    """Return the quartiles of the thread's CPU time [s] in a call, which is repeated up to a total time."""
    times: list[float] = []
    while len(times) < REPEATS[0] or (sum(times) < TIMED and len(times) < REPEATS[1]):
        started = time.thread_time()
        work()
        times.append(time.thread_time() - started)
    return statistics.quantiles(times, n=4, method="inclusive")


def cheapest(points: list[Point], target: float) -> Point:
    """Return the point with the least work whose error is at most `target`.

    Raises:
        ConfigError: no point meets the target.
    """
    candidates = [p for p in points if p.error <= target]
    if not candidates:
        raise ConfigError(f"--target {target:g}", f"no method meets this error{smallest_error(points)}")
    return min(candidates, key=lambda p: p.work)


def smallest_error(points: list[Point]) -> str:
    """Return the end of a refusal: the smallest error with its method and setting, and the finest setting tried."""
    if not points:
        return "; every run failed"
    best = min(points, key=lambda p: p.error)
    finest = min(p.setting for p in points if p.unit == best.unit)
    setting = f"{'tolerance' if best.unit == 'tol' else 'step'} {best.setting:g}"
    return f"; the smallest error is {best.error:.2g}, by {best.method} at {setting}; tried down to {finest:g}"


def pareto_points(points: list[Point], levels: list[float]) -> list[Point]:
    """Return the point of each method with the least work at each of these errors."""
    selected: list[Point] = []
    for method in dict.fromkeys(p.method for p in points):
        own = [p for p in points if p.method == method]
        for level in levels:
            candidates = [p for p in own if p.error <= level]
            if candidates and (result := min(candidates, key=lambda p: p.work)) not in selected:
                selected.append(result)
    return selected


def check_target(target: float | None) -> None:
    """Check that a target is a valid error.

    Raises:
        ValueError: the target is not a positive finite number.
    """
    if target is not None and not (target > 0.0 and math.isfinite(target)):
        raise ValueError(f"--target {target:g}: expected an error above 0, for example 1e-6")
