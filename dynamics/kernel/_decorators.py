"""The decorators of compiled functions."""

from collections.abc import Callable
from typing import Any, TypeVar

from numba.core import config

from dynamics.kernel._cache import KernelCache
from dynamics.kernel._pipeline import KernelDispatcher, Pipeline

F = TypeVar("F", bound=Callable[..., Any])


def _compile(function: Callable, **options: Any) -> Any:
    if config.DISABLE_JIT:  # type: ignore[attr-defined]
        return function
    options = {"nopython": True, "nogil": True, "error_model": "numpy", **options}
    compiled = KernelDispatcher(py_func=function, targetoptions=options, pipeline_class=Pipeline)
    compiled._cache = KernelCache(compiled)
    return compiled


def uncompiled(function: F) -> F:
    """The Python function of a kernel: for numpy arrays instead of numbers, and for single numbers in Python code."""
    return function.py_func  # type: ignore[attr-defined]


def kernel(function: F) -> F:
    """Compile a pure function: cached on disk, releases the GIL, divides as IEEE 754 says (no ZeroDivisionError)."""
    return _compile(function)


def leaf(function: F) -> F:
    """The same for small functions that are always inlined into their caller."""
    return _compile(function, forceinline=True)
