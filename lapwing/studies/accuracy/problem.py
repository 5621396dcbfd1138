"""Problems with a known solution, and the methods that solve them."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np


class SolverRun(NamedTuple):
    """Result of one run of a method."""

    times: np.ndarray  # of the samples, shape (k,), the first the start, the last the end
    samples: np.ndarray  # coordinates (lapwing/studies/accuracy/coordinates.py) at these times, shape (k, n)
    defect: float  # how far the end is off its manifold
    evaluations: int | None  # of the right-hand side; None where they are not known


class SolverMethod(NamedTuple):
    """One method, for one problem.

    A setting is its step or its tolerance. `prepare(setting)` returns the timed function, which does all the work and
    nothing else; `read(setting, result of that call)` its Outcome, or None where the run failed; `idle()` is the same
    call without a single step, whose time is taken off.
    """

    name: str
    order: int
    unit: str  # of the settings: "s", or "tol" for a tolerance
    settings: Sequence[float]  # coarse to fine
    prepare: Callable[[float], Callable[[], Any]]
    read: Callable[[float, Any], SolverRun | None]
    idle: Callable[[], Any]
    extended: Callable[[float], np.ndarray] | None = None  # coordinates at the end by the steps in extended precision


class Problem(NamedTuple):
    """A system from a start to an end."""

    title: str
    unit: str  # of time
    duration: float
    ways: Sequence[SolverMethod]
    reference: Callable[[], np.ndarray]  # coordinates at the end, shape (n,)
    source: str  # what the reference is
    invariants: dict[str, Callable[[np.ndarray, np.ndarray], np.ndarray]]  # (times, samples) -> values, shape (k, ...)
