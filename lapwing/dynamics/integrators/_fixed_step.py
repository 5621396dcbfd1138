"""Steps of any method on any system, both selected by the type of an argument, compiled once and cached on disk.

A method's empty `Method` class and a system's parameter class stand for their functions: values of them can be stored.
"""

from collections import namedtuple

from lapwing.kernels import DispatchTable, always_inline, kernel
from lapwing.kernels.codegen import generic
from lapwing.kernels.state_tree import finite, flatten

RATES = DispatchTable()
"""The compiled `rate(p, t, x)` of a system, by the NamedTuple class of its parameters."""
STEPS = DispatchTable("step")
"""The compiled `step` of a method, by its `Method`."""


def method_token(module: str) -> type:
    """Return the empty class that identifies a method in compiled code: `Method` of the module, named as the module.

    The name matters: numba distinguishes compiled versions of a function by the *names* of the argument types, and
    treats two classes of the same name and fields as one. A system's parameter class therefore needs a unique name.
    """
    result = namedtuple(module.rpartition(".")[2], (), module=module)  # type: ignore[misc]
    result.__qualname__ = "Method"
    return result


@generic()
def _rate(p, t, x):
    """Dispatch by the class of p."""
    return RATES[p.instance_class]


@always_inline
def rate(p, t, x):
    """Return the tangent at state x and time t of the system with parameters p."""
    return _rate(p, t, x)


@generic()
def step(method, p, t, x, h):
    """Return the state at t + h: one step of `method` (an instance of its module's `Method`) with parameters p."""
    one_step = STEPS[method.instance_class]
    return lambda method, p, t, x, h: one_step(rate, p, t, x, h)


@kernel
def integrate_fixed(method, p, t, x, h, n):
    """Return the state after n steps of h from time t, in a compiled loop without checks."""
    for i in range(n):
        x = step(method, p, t + i * h, x, h)
    return x


@kernel
def record(method, p, t, x, h, every, out):
    """Integrate, and write every `every`-th state into the rows of `out`, starting with x itself.

    Stop after a non-finite row. Return the number of finite rows.
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
