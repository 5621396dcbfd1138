"""Steps of any method on any system, both chosen by the type of an argument: compiled once per pair and kept on disk.

Functions passed as arguments never hit numba's disk cache; a method's empty `Method` class and a system's parameter
class do.
"""

import sys
from collections import namedtuple
from typing import Any

from lapwing.kernels import DispatchTable, always_inline, kernel
from lapwing.kernels.codegen import overload_for
from lapwing.kernels.state_tree import finite, flatten

RATES = DispatchTable()
"""The compiled `rate(p, t, x)` of a system, by the NamedTuple class of its parameters."""


def method_token(module: str) -> type:
    """The class that names a method in compiled code: empty, `Method` in the module, called as the module.

    The name matters: numba tells compiled versions of one function apart by the *names* of the argument types, and
    takes two classes of the same name and fields for one (so a system's parameter class needs a name of its own).
    """
    found = namedtuple(module.rpartition(".")[2], (), module=module)  # type: ignore[misc]
    found.__qualname__ = "Method"
    return found


def _rate(p, t, x):
    """Dispatch by the class of p."""


@overload_for(_rate)
def _rate_of(p, t, x):
    return RATES[p.instance_class]


@always_inline
def rate(p, t, x):
    """The tangent at state x and time t of the system with parameters p."""
    return _rate(p, t, x)


def step(method: Any, p: Any, t: float, x: Any, h: float) -> Any:
    """The state at t + h: one step of `method` (an instance of its module's `Method`) on the system of parameters p."""
    return sys.modules[type(method).__module__].step(rate, p, t, x, h)


@overload_for(step)
def _step(method, p, t, x, h):
    one_step = sys.modules[method.instance_class.__module__].step
    return lambda method, p, t, x, h: one_step(rate, p, t, x, h)


@kernel
def integrate_fixed(method, p, t, x, h, n):
    """The state after n steps of h from time t (compiled loop; no checks)."""
    for i in range(n):
        x = step(method, p, t + i * h, x, h)
    return x


@kernel
def record(method, p, t, x, h, every, out):
    """March and write every `every`-th state's numbers into the rows of `out`, the first being x itself.

    Stops after a row that is not finite; returns how many rows are.
    """
    n = 0
    for row in range(out.shape[0]):
        if row > 0:
            for _ in range(every):
                x = step(method, p, t + n * h, x, h)
                n += 1
        numbers = flatten(x)
        for i in range(len(numbers)):
            out[row, i] = numbers[i]
        if not finite(x):
            return row
    return out.shape[0]
