"""Integrators: one file for each method, discovered in this folder. To add a method, add a file.

A method file has `ORDER`, `ON_MANIFOLD` (True if a step keeps manifold leaves on the manifold to round-off), a class
`Method` that names it in compiled code, and a compiled `step(rate, p, t, x, h)` that returns the state at t + h.
`rate(p, t, x)` returns the tangent of the state tree x (see lapwing/kernels/state_tree.py) for parameters p.

Optional: `EVALUATIONS`, the number of rate evaluations of a step if it is fixed; `FLAT_ORDER`, the order without
curvature if it is higher; `increment`, the change of the numbers of x in a step before the projection onto the
manifold; `incompatibility(p, x)` of a method that does not support every system.
"""

from types import ModuleType
from typing import Any

from lapwing.dynamics import discovery
from lapwing.dynamics.integrators._adaptive import integrate_adaptive
from lapwing.dynamics.integrators._compensated import (
    INCREMENTS,
    CompensatedSum,
    CompensatedSummation,
    add,
    exact,
    extrapolate,
    is_compensated,
    rounded,
    value_of,
)
from lapwing.dynamics.integrators._fixed_step import RATES, STEPS, integrate_fixed, rate, record, step
from lapwing.dynamics.integrators._pieces import BREAKPOINTS
from lapwing.dynamics.integrators._solve import check_start, not_finite, simulate, solve
from lapwing.dynamics.integrators._step_doubling import (
    LEAST_TOLERANCE,
    SHORTEST,
    StepDoubling,
    integrate_step_doubling,
    shorter,
)

__all__ = [
    "BREAKPOINTS",
    "INCREMENTS",
    "LEAST_TOLERANCE",
    "RATES",
    "SHORTEST",
    "STEPS",
    "CompensatedSum",
    "CompensatedSummation",
    "StepDoubling",
    "add",
    "check_start",
    "compatible_methods",
    "exact",
    "extrapolate",
    "get",
    "incompatibility",
    "integrate_adaptive",
    "integrate_fixed",
    "integrate_step_doubling",
    "is_compensated",
    "names",
    "not_finite",
    "rate",
    "record",
    "rounded",
    "shorter",
    "simulate",
    "solve",
    "step",
    "value_of",
]


def names() -> list[str]:
    """Return the names of all methods: their file names."""
    return discovery.names(__name__)


def get(name: str) -> ModuleType:
    """Return the module of a method. Raise ValueError with the choices if there is none."""
    return discovery.get(__name__, name, "integrator")


def incompatibility(name: str, p: Any, x: Any) -> str:
    """Return the reason why a method does not support parameters p and states like x; "" if it does."""
    module = get(name)
    return module.incompatibility(p, x) if hasattr(module, "incompatibility") else ""


def compatible_methods(p: Any, x: Any) -> list[str]:
    """Return the names of the methods that support parameters p and states like x."""
    return [name for name in names() if not incompatibility(name, p, x)]
