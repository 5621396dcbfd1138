"""The integrators: one file per method, found by scanning this folder; adding a method is adding a file.

A method file has `ORDER`, `ON_MANIFOLD` (does a step keep manifold leaves on the manifold to round-off?), a class
`Method` that names it in compiled code, and a compiled `step(rate, p, t, x, h)` that returns the state at t + h, where
`rate(p, t, x)` gives the tangent of the state tree x (see dynamics/tree.py) for parameters p. Three more if they apply:
`EVALUATIONS` of the rate in a step where their number is fixed, `FLAT_ORDER`, the order without curvature where that is
higher, and `REQUIRES`, the fields that the state must have.
"""

from types import ModuleType

from dynamics import discovery
from dynamics.integrators._adaptive import adapt
from dynamics.integrators._march import RATES, march, rate, record, step
from dynamics.integrators._solve import check_start, not_finite, simulate, solve

__all__ = [
    "RATES",
    "adapt",
    "check_start",
    "get",
    "march",
    "names",
    "not_finite",
    "rate",
    "record",
    "simulate",
    "solve",
    "step",
]


def names() -> list[str]:
    """Every method's name: its file name."""
    return discovery.names(__name__)


def get(name: str) -> ModuleType:
    """The module of a method; ValueError that lists the choices if there is none."""
    return discovery.get(__name__, name, "integrator")
