"""The integrators: one file per method, found by scanning this folder; adding a method is adding a file.

A method file has `ORDER`, `ON_MANIFOLD` (does a step keep manifold leaves on the manifold to round-off?), a class
`Method` that names it in compiled code, and a compiled `step(rate, p, t, x, h)` that returns the state at t + h, where
`rate(p, t, x)` gives the tangent of the state tree x (see dynamics/tree.py) for parameters p. Two more if they apply:
`FLAT_ORDER`, the order without curvature where that is higher, and `REQUIRES`, the fields that the state must have.
"""

import importlib
import pkgutil
from types import ModuleType

from dynamics.integrators._march import RATES, march, rate, step
from dynamics.integrators._solve import check_start, not_finite, simulate, solve

__all__ = ["RATES", "check_start", "get", "march", "names", "not_finite", "rate", "simulate", "solve", "step"]


def names() -> list[str]:
    """Every method's name: its file name."""
    return sorted(m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_"))


def get(name: str) -> ModuleType:
    """The module of a method; ValueError that lists the choices if there is none."""
    if name not in names():
        raise ValueError(f"unknown integrator {name!r}: choose one of {', '.join(names())}")
    return importlib.import_module(f"{__name__}.{name}")
