"""Solver methods for a system of `dynamics`: every compatible integrator."""

from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np

from lapwing.dynamics import integrators
from lapwing.dynamics.integrators import integrate_adaptive, rate, record
from lapwing.kernels import kernel, python_function
from lapwing.kernels.state_tree import flatten, unflatten
from lapwing.studies.accuracy.coordinates import coordinates, defect
from lapwing.studies.accuracy.problem import SolverMethod, SolverRun
from lapwing.studies.accuracy.round_off import end_in_extended_precision

ADAPTIVE = "rkmk54"  # method of `integrate_adaptive`
SAMPLES = 8  # samples of a run for its invariants; every number of steps is a multiple
HALVINGS = 18
TOLERANCES = tuple(10.0**-k for k in range(1, 14))


def count_evaluations(method: ModuleType, p: Any, x: Any, h: float, times: np.ndarray, rows: np.ndarray) -> float:
    """Return the mean number of evaluations in a step of h, over these times and states (uncompiled)."""
    calls = 0

    def count_and_evaluate(p: Any, t: float, state: Any) -> Any:
        nonlocal calls
        calls += 1
        return rate(p, t, state)

    for t, row in zip(times, rows, strict=True):
        python_function(method.step)(count_and_evaluate, p, float(t), unflatten(x, tuple(map(float, row))), h)
    return calls / len(times)


# kernels of this file, so that their cache refers only to classes that every user of the study can import
@kernel
def sample_states(method: Any, p: Any, x: Any, h: float, every: int, out: np.ndarray) -> int:
    """Integrate from time 0 in steps of h; store each `every`-th state in `out`. Return the number of finite rows."""
    return record(method, p, 0.0, x, h, every, out)


@kernel
def adapt_step(p: Any, x: Any, times: np.ndarray, tolerance: float, out: np.ndarray) -> Any:
    """Write the states at `times` into the rows of `out`; see `integrate_adaptive`."""
    return integrate_adaptive(p, x, times, tolerance, out)


def solver_methods(p: Any, x: Any, duration: float, coarsest: int) -> list[SolverMethod]:
    """Return a solver method per integrator, with tolerances as settings of the adaptive one.

    Args:
        p: parameters of the system (its class is in `RATES`).
        x: state at time 0.
        duration: duration of the run.
        coarsest: steps of the coarsest run; a multiple of SAMPLES.
    """
    fixed = fixed_step_methods(p, x, duration, coarsest)
    return [_adaptive(p, x, duration) if method.name == ADAPTIVE else method for method in fixed]


def fixed_step_methods(p: Any, x: Any, duration: float, coarsest: int) -> list[SolverMethod]:
    """Return a solver method per integrator, with steps as settings."""
    return [_fixed_step_method(name, p, x, duration, coarsest) for name in integrators.compatible_methods(p, x)]


def _fixed_step_method(name: str, p: Any, x: Any, duration: float, coarsest: int) -> SolverMethod:
    method, width = integrators.get(name), len(flatten(x))
    token = method.Method()

    def steps(h: float) -> int:
        return round(duration / h)

    def prepare(h: float) -> Callable[[], Any]:
        out, every = np.empty((SAMPLES + 1, width)), steps(h) // SAMPLES
        return lambda: (sample_states(token, p, x, duration / steps(h), every, out), out)

    def read(h: float, result: Any) -> SolverRun | None:
        rows, out = result
        if rows < len(out):
            return None
        times = np.linspace(0.0, duration, SAMPLES + 1)
        per_step = getattr(method, "EVALUATIONS", None) or count_evaluations(method, p, x, h, times[:-1], out[:-1])
        evaluations = round(steps(h) * per_step)
        return SolverRun(times, coordinates(x, out), defect(x, out[-1]), evaluations)

    settings = [duration / (coarsest * 2**k) for k in range(HALVINGS)]
    start = np.empty((1, width))
    return SolverMethod(
        name, method.ORDER, "s", settings, prepare, read, lambda: sample_states(token, p, x, duration, 1, start),
        lambda h: end_in_extended_precision(method, p, x, duration / steps(h), steps(h)),
    )  # fmt: skip


def _adaptive(p: Any, x: Any, duration: float) -> SolverMethod:
    method, ends = integrators.get(ADAPTIVE), np.array([0.0, duration])

    def prepare(tolerance: float) -> Callable[[], Any]:
        out = np.empty((2, len(flatten(x))))
        return lambda: (adapt_step(p, x, ends, tolerance, out), out)

    def read(tolerance: float, result: Any) -> SolverRun | None:
        (status, _, _, steps, rejected), out = result
        if status != 0:
            return None
        # the first stage is the last of the step before
        evaluations = 1 + (method.EVALUATIONS - 1) * (steps + rejected)
        return SolverRun(ends, coordinates(x, out), defect(x, out[-1]), evaluations)

    start = np.empty((1, len(flatten(x))))
    return SolverMethod(
        ADAPTIVE, method.ORDER, "tol", TOLERANCES, prepare, read, lambda: adapt_step(p, x, ends[:1], 1.0, start)
    )
