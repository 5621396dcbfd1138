"""Effects through which the wind acts on a vehicle."""

from collections.abc import Callable
from types import CodeType
from typing import Any

from lapwing.dynamics.effects._hooks import HOOKS
from lapwing.kernels import python_function

AIR = {"wind_world", "air_rate_body"}  # fields of the situation that the wind changes
LOADS = ("load_factors", "loads", "memory_rate", "wrench", "wrench_and_rate", "wrench_body", "torque")


def uses_wind(effect: Any) -> bool:
    """Return True if the forces of an effect depend on the wind: a hook, or a function that it calls, reads it."""
    known: set[CodeType] = set()
    return any(_reads_air(HOOKS[name][type(effect)], known) for name in LOADS if type(effect) in HOOKS[name])


def _reads_air(function: Callable, known: set[CodeType]) -> bool:
    python: Any = python_function(function)
    code = python.__code__
    if code in known:
        return False
    known.add(code)
    called = [python.__globals__.get(name) for name in code.co_names]
    called += [cell.cell_contents for cell in python.__closure__ or ()]
    functions = (each for each in called if hasattr(getattr(each, "py_func", each), "__code__"))
    return not AIR.isdisjoint(code.co_names) or any(_reads_air(each, known) for each in functions)
