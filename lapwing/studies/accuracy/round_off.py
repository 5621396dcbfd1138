"""Round-off error: comparison of equal steps in double and in extended precision.

Both runs execute the source of the same kernels with the same step and the same coefficients, so that their difference
is the rounding of doubles alone. Random numbers are doubles in both runs.
"""

from collections.abc import Callable
from types import CellType, FunctionType, ModuleType, SimpleNamespace
from typing import Any, NamedTuple

import numba
import numpy as np

from lapwing.dynamics import noise
from lapwing.dynamics.integrators import RATES
from lapwing.kernels import math, simd
from lapwing.kernels.codegen import GENERATORS
from lapwing.studies.accuracy.coordinates import coordinates, error
from lapwing.studies.accuracy.extended_numbers import FUNCTIONS, VECTOR_FUNCTIONS, Number
from lapwing.studies.accuracy.problem import Problem

STEPS = 400  # at least
METHOD = "rk4_renormalised"
_MATH = SimpleNamespace(**FUNCTIONS, pi=math.pi, tau=math.tau, inf=math.inf, nan=math.nan)


class RoundOff(NamedTuple):
    """Round-off error at the end of a run."""

    method: str
    steps: int
    error: float  # largest difference of coordinates, relative to 1 + size


def measure(problem: Problem) -> RoundOff | None:
    """Return the round-off error of a problem, None if its methods have no extended numbers."""
    method = next((method for method in problem.methods if method.name == METHOD), None)
    if method is None or method.extended is None:
        return None
    settings = [h for h in method.settings if round(problem.duration / h) >= STEPS]
    outcome = method.read(settings[0], method.prepare(settings[0])()) if settings else None
    if outcome is None or not np.isfinite(outcome.samples).all():
        return None
    exact = method.extended(settings[0])
    return RoundOff(METHOD, round(problem.duration / settings[0]), error(outcome.samples[-1], exact))


def end_in_extended_precision(method: ModuleType, p: Any, x: Any, h: float, steps: int) -> np.ndarray:
    """Return the coordinates at the end of a run in extended numbers, shape (n,).

    Args:
        method: integrator.
        p: parameters of the system (its class is in `RATES`).
        x: state at time 0.
        h: step.
        steps: number of steps.

    Raises:
        TypeError: part of the system does not compute in extended precision.
    """
    step, rate = extend(method.step), extend(RATES[type(p)])
    state, p = in_extended_precision(x), in_extended_precision(p)
    for n in range(steps):
        state = step(rate, p, Number(n * h), state, Number(h))
    return coordinates_in_extended_precision(x, state)


def coordinates_in_extended_precision(x: Any, state: Any) -> np.ndarray:
    """Return the coordinates of a state in extended numbers, shape (n,).

    Args:
        x: state of the same shape, in doubles.
        state: state in extended numbers.

    Raises:
        TypeError: part of the state is a double.
    """
    numbers = _numbers(state)
    if not all(isinstance(number, Number) for number in numbers):
        raise TypeError(f"{type(x).__name__}: a step returns doubles for extended numbers")
    return coordinates(x, np.array([numbers], object))[0]


def in_extended_precision(tree: Any) -> Any:
    """Return a tree with its doubles as extended numbers."""
    return _map_leaves(float, Number, tree)


def extend(function: Any) -> Callable[..., Any]:
    """Return the Python function of a kernel that computes, with all its callees, in extended numbers."""
    return _extend(function, {})


def _extend(function: Any, known: dict[FunctionType, Any]) -> Any:
    if function is math:
        return _MATH
    if isinstance(function, ModuleType) and function.__name__.startswith("lapwing"):
        return _Module(function, known)
    if isinstance(function, type(simd.pack4)):
        return VECTOR_FUNCTIONS.get(function, function)
    generate = _generator(function)
    python = getattr(function, "py_func", function)
    is_own = python is not function or (getattr(python, "__module__", None) or "lapwing").startswith("lapwing")
    if not isinstance(python, FunctionType) or not is_own:
        return function
    if python in known:
        return known[python]
    if python.__module__ == noise.__name__:
        return lambda *values: in_extended_precision(function(*_map_leaves(Number, float, values)))
    if generate is not None:
        result: Any = _extend_generator(generate, known)
        known[python] = result
        return result
    names = dict(python.__globals__)
    cells = tuple(CellType() for _ in python.__closure__ or ()) or None
    result = FunctionType(python.__code__, names, python.__name__, python.__defaults__, cells)
    known[python] = result
    for cell, original in zip(cells or (), python.__closure__ or (), strict=True):
        cell.cell_contents = _extend(original.cell_contents, known)
    names |= {name: _extend(names[name], known) for name in python.__code__.co_names if name in names}
    return result


class _Module:
    """A module whose functions compute with extended numbers."""

    def __init__(self, module: ModuleType, known: dict[FunctionType, Any]):
        self._module, self._known = module, known

    def __getattr__(self, name: str) -> Any:
        return _extend(getattr(self._module, name), self._known)


def _generator(function: Any) -> Callable[..., Any] | None:
    """Return the generator of a function that exists only in compiled code; None for a Python function."""
    if not isinstance(function, FunctionType):
        return None
    code = function.__code__
    is_generated = "NotImplementedError" in code.co_names or "generate" in code.co_freevars
    return GENERATORS.get(function) if is_generated else None


def _extend_generator(generate: Callable[..., Any], known: dict[FunctionType, Any]) -> Callable[..., Any]:
    variants: dict[Any, Any] = {}

    def call(*values: Any) -> Any:
        key = tuple(map(_shape, values))
        if key not in variants:
            variants[key] = _extend(
                generate(*(numba.typeof(_map_leaves(Number, float, value)) for value in values)), known
            )
        return variants[key](*values)

    return call


def _shape(value: Any) -> Any:
    return (type(value), *map(_shape, value)) if isinstance(value, tuple) else type(value)


def _map_leaves(source: type, target: Callable[[Any], Any], tree: Any) -> Any:
    """Return a tree with `target(leaf)` in place of each leaf of type `source`."""
    if not isinstance(tree, tuple):
        return target(tree) if isinstance(tree, source) else tree
    items = [_map_leaves(source, target, item) for item in tree]
    return type(tree)(*items) if hasattr(tree, "_fields") else tuple(items)


def _numbers(tree: Any) -> list[Any]:
    return [leaf for item in tree for leaf in _numbers(item)] if isinstance(tree, tuple) else [tree]
