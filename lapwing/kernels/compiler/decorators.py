"""Decorators of compiled functions.

With a version of numba or llvmlite that is not known to work with the compile pipeline, numba's own passes are used:
only the compile time differs, not the results.
"""

from collections.abc import Callable
from functools import cache
from types import FunctionType
from typing import Any, TypeVar

from numba.core import config
from numba.core.registry import CPUDispatcher

from lapwing.kernels.compiler.cache import KernelCache
from lapwing.kernels.compiler.numba_versions import PlainCache, PlainDispatcher, is_supported

_Dispatcher: type[CPUDispatcher] = PlainDispatcher
_Cache: type[KernelCache] = PlainCache
if is_supported():  # only then can the pipeline be imported
    from lapwing.kernels.compiler.pipeline import KernelDispatcher, PipelineCache

    _Dispatcher, _Cache = KernelDispatcher, PipelineCache

F = TypeVar("F", bound=Callable[..., Any])


def _compile(function: Callable, **options: Any) -> Any:
    if config.DISABLE_JIT:  # type: ignore[attr-defined]
        return function
    options = {"nopython": True, "nogil": True, "error_model": "numpy", **options}
    compiled = _Dispatcher(py_func=function, targetoptions=options)
    compiled._cache = _Cache(compiled)
    return compiled


def generated(function: Any, inline: bool) -> Any:
    """Compile a function made for the types of its arguments; return a kernel unchanged."""
    return function if isinstance(function, _Dispatcher) else _compile(function, forceinline=inline)


@cache
def python_function(function: F) -> F:
    """Return the Python function of a kernel, which calls the Python functions of the kernels that it names.

    Use it for numpy arrays in place of numbers, and for single evaluations: the first call of a compiled function takes
    a process a quarter of a second.
    """
    python: Any = getattr(function, "py_func", function)
    names = python.__globals__
    called = {
        name: python_function(names[name])
        for name in python.__code__.co_names
        if isinstance(names.get(name), _Dispatcher)
    }
    if not called:
        return python
    return FunctionType(python.__code__, {**names, **called}, python.__name__, python.__defaults__, python.__closure__)  # type: ignore[return-value]


def kernel(function: F) -> F:
    """Compile a pure function: cached on disk, without the GIL, division by IEEE 754 (no ZeroDivisionError)."""
    return _compile(function)


def noinline(function: F) -> F:
    """Compile a large helper without inlining, so that LLVM optimises it once instead of at every call site.

    A function without this decorator is always inlined if the first function that calls it is.
    """
    function.__noinline__ = True  # type: ignore[attr-defined]
    return _compile(function, forceinline=False)


def vectorise_loops(function: F) -> F:
    """Compile a kernel whose loop over batch elements LLVM vectorises.

    A loop that calls functions looks small until these are inlined; unrolled before that, it cannot be vectorised.
    """
    function.__vectorise_loops__ = True  # type: ignore[attr-defined]
    return _compile(function)


def no_refcount(function: F) -> F:
    """Compile a kernel without reference counting, which takes half of the time of a flight.

    Call it by its address only. Its arguments belong to its caller until it returns; it may change arrays in place but
    not replace one. A kernel that allocates arrays counts references all the same.
    """
    function.__no_refcount__ = True  # type: ignore[attr-defined]
    return _compile(function)


def always_inline(function: F) -> F:
    """Compile a small function that is always inlined into its caller."""
    return _compile(function, forceinline=True)
