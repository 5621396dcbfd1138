"""The decorators of compiled functions."""

from collections.abc import Callable
from typing import Any, TypeVar

import numba
from numba.core.dispatcher import Dispatcher

from dynamics.kernel._cache import KernelCache

F = TypeVar("F", bound=Callable[..., Any])


def _compile(function: Callable, **options: bool) -> Any:
    compiled = numba.njit(error_model="numpy", nogil=True, **options)(function)
    if isinstance(compiled, Dispatcher):  # not so with NUMBA_DISABLE_JIT
        compiled._cache = KernelCache(compiled)  # type: ignore[attr-defined]
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
