"""The decorators of compiled functions."""

from collections.abc import Callable
from functools import cache
from types import FunctionType
from typing import Any, TypeVar

from numba.core import config

from lapwing.kernels.compiler.cache import KernelCache
from lapwing.kernels.compiler.pipeline import KernelDispatcher, Pipeline

F = TypeVar("F", bound=Callable[..., Any])


def _compile(function: Callable, **options: Any) -> Any:
    if config.DISABLE_JIT:  # type: ignore[attr-defined]
        return function
    options = {"nopython": True, "nogil": True, "error_model": "numpy", **options}
    compiled = KernelDispatcher(py_func=function, targetoptions=options, pipeline_class=Pipeline)
    compiled._cache = KernelCache(compiled)
    return compiled


def uncached(function: Any) -> Any:
    """Compile a function that every process makes anew, and of which nothing is kept on the disk; a kernel as it is."""
    if isinstance(function, KernelDispatcher):
        return function
    return KernelDispatcher(py_func=function, targetoptions={"nopython": True}, pipeline_class=Pipeline)


@cache
def python_function(function: F) -> F:
    """The Python function of a kernel, on those of the kernels that it calls by name.

    For numpy arrays instead of numbers, and for single numbers in Python code: the first call of anything compiled
    takes a process a quarter of a second.
    """
    python: Any = getattr(function, "py_func", function)
    known = python.__globals__
    called = {
        name: python_function(known[name])
        for name in python.__code__.co_names
        if isinstance(known.get(name), KernelDispatcher)
    }
    if not called:
        return python
    return FunctionType(python.__code__, {**known, **called}, python.__name__, python.__defaults__, python.__closure__)  # type: ignore[return-value]


def kernel(function: F) -> F:
    """Compile a pure function: cached on disk, releases the GIL, divides as IEEE 754 says (no ZeroDivisionError)."""
    return _compile(function)


def noinline(function: F) -> F:
    """The same for large functions that others call: never inlined, so that LLVM looks at them once, not at each copy.

    A function that is not marked so inherits from the first that calls it whether it is always inlined.
    """
    function.__apart__ = True  # type: ignore[attr-defined]
    return _compile(function, forceinline=False)


def vectorise_loops(function: F) -> F:
    """The same for a kernel with a loop over members side by side, which LLVM is to vectorise.

    Loops that call functions look small until those are inlined; unrolled by then, they cannot be vectorised.
    """
    function.__vectorised__ = True  # type: ignore[attr-defined]
    return _compile(function)


def no_refcount(function: F) -> F:
    """The same for a kernel that is called by its address alone, and changes arrays in place or not at all.

    What it is given belongs to its caller until it returns, so that no references need to be counted: half of the time
    of a flight. It must not put an array in another's place; one that makes arrays counts as any other.
    """
    function.__uncounted__ = True  # type: ignore[attr-defined]
    return _compile(function)


def always_inline(function: F) -> F:
    """The same for small functions that are always inlined into their caller."""
    return _compile(function, forceinline=True)
