"""Problems with a known solution, and the methods that solve them."""

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np


class SolverRun(NamedTuple):
    """Result of one run of a method."""

    times: np.ndarray  # times of the samples including start and end, shape (k,)
    samples: np.ndarray  # coordinates (lapwing/studies/accuracy/coordinates.py) at these times, shape (k, n)
    defect: float  # distance of the final state from its manifold
    evaluations: int | None  # evaluations of the right-hand side; None if unknown


class SolverMethod(NamedTuple):
    """One method for one problem.

    A setting is its step or its tolerance. `prepare(setting)` returns the timed function, which does only the
    integration. `read(setting, result)` returns its `SolverRun`, or None if the run failed. `idle()` is the same call
    without a step, whose time is subtracted.
    """

    name: str
    order: int
    unit: str  # of the settings: "s", or "tol" for a tolerance
    settings: Sequence[float]  # coarse to fine
    prepare: Callable[[float], Callable[[], Any]]
    read: Callable[[float, Any], SolverRun | None]
    idle: Callable[[], Any]
    extended: Callable[[float], np.ndarray] | None = None  # final coordinates in extended precision


class Problem(NamedTuple):
    """An initial value problem with its reference solution and the methods to compare."""

    title: str
    duration: float
    methods: Sequence[SolverMethod]
    reference: Callable[[], np.ndarray]  # final coordinates, shape (n,)
    source: str  # description of the reference
    invariants: Mapping[str, Callable[[np.ndarray, np.ndarray], np.ndarray]] = MappingProxyType({})
    """By name: (times, samples) -> values, shape (k, ...)."""
    unit: str = "s"  # unit of time
