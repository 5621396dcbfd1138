"""Functions whose source is generated for the types of their arguments: straight-line code instead of tuple loops.

A kernel can neither index a tuple of mixed types by a variable nor select a function by a class. The source of such
calls is generated at compile time and has no cost at run time. All generated source is compiled here.
"""

import inspect
import sys
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any

import numba
from numba.core import types
from numba.core.targetconfig import ConfigStack
from numba.core.typing.templates import AbstractTemplate, infer_global

from lapwing.kernels import DispatchTable, generated

GENERATORS: dict[Callable, Callable[..., Any]] = {}
"""Functions with a separate implementation in compiled code, and its generator from the numba types of arguments."""


def compile_source(signature: str, names: Mapping[str, Any], *lines: str) -> Callable:
    """Compile a function from source text.

    Args:
        signature: "name(arguments)".
        names: objects that the body may refer to.
        lines: statements of the body.
    """
    scope = {"__name__": __name__, **names}  # the cache requires a module
    exec("\n    ".join([f"def {signature}:", *lines]), scope)
    return scope[signature.partition("(")[0]]


def generic(*, inline: bool = False) -> Callable[[Callable[..., Callable]], Callable[..., Any]]:
    """Return a decorator for the generator of a function whose implementation depends on the types of its arguments.

    The generator has the name, the arguments and the docstring of that function. It gets the numba types of the
    arguments and returns the implementation: a function of the same arguments, or an existing kernel, which needs no
    further compilation. Called from Python, the implementation runs uncompiled, which is slow: do this in tests and
    configuration only.

    Args:
        inline: True to inline the implementation into every caller, unless a kernel declares this itself.
    """

    def decorate(generate: Callable[..., Callable]) -> Callable[..., Any]:
        @wraps(generate)
        def function(*values: Any) -> Any:
            return generate(*map(numba.typeof, values))(*values)

        _implement(function, generate, inline)
        return function

    return decorate


def dispatch(table: DispatchTable, argument: int = 0, field: str = "") -> Callable[..., Any]:
    """Return a function for kernels that calls the implementation for the class of one of its arguments.

    Args:
        table: implementations by class.
        argument: index of the argument.
        field: field of the implementation to call, if it has several functions.
    """

    def call(*arguments: Any) -> Any:
        found = table[arguments[argument].instance_class]
        return getattr(found, field) if field else found

    call.__module__ = sys._getframe(1).f_globals["__name__"]  # whose source is part of the key of callers
    return generic(inline=True)(call)


def overload_for(function: Callable, *, inline: bool = False) -> Callable[[Callable[..., Callable]], Callable]:
    """Return a decorator like `generic` for a function that has an implementation in Python, too."""

    def decorate(choose: Callable[..., Callable]) -> Callable:
        _implement(function, choose, inline)
        return choose

    return decorate


def _implement(function: Callable, choose: Callable[..., Any], inline: bool) -> None:
    chosen: dict[tuple, Any] = {}
    GENERATORS[function] = choose

    class Implementation(AbstractTemplate):
        key = function

        def generic(self, args: tuple, kws: dict) -> Any:
            if kws:
                args = inspect.signature(function).bind(*args, **kws).args
            flags = ConfigStack().top().copy()
            flags.forceinline = flags.forceinline or inline
            if (args, flags.forceinline) not in chosen:
                chosen[args, flags.forceinline] = generated(choose(*args), flags.forceinline)
            kernel = types.Dispatcher(chosen[args, flags.forceinline])
            with ConfigStack().enter(flags):
                signature = kernel.get_call_type(self.context, args, {})
            self._entry = kernel.get_overload(signature)
            return signature

        def get_impl_key(self, sig: Any) -> Any:
            return self._entry

    infer_global(function, types.Function(Implementation))


def map_tuple(function: Callable, common: Any, a: tuple, b: tuple) -> tuple:
    """Return (function(common, a[0], b[0]), function(common, a[1], b[1]), ...) for tuples of equal length."""
    return tuple(function(common, x, y) for x, y in zip(a, b, strict=True))


@overload_for(map_tuple, inline=True)
def _map_tuple(function, common, a, b):
    calls = "".join(f"function(common, a[{i}], b[{i}]), " for i in range(len(a)))
    return compile_source("map_tuple(function, common, a, b)", {}, f"return ({calls})")


def reduce_tuple(function: Callable, common: Any, value: Any, a: tuple, b: tuple) -> Any:
    """Return the result of value = function(common, value, a[i], b[i]) for i = 0, 1, ... in order."""
    for x, y in zip(a, b, strict=True):
        value = function(common, value, x, y)
    return value


@overload_for(reduce_tuple, inline=True)
def _reduce_tuple(function, common, value, a, b):
    calls = [f"value = function(common, value, a[{i}], b[{i}])" for i in range(len(a))]
    return compile_source("reduce_tuple(function, common, value, a, b)", {}, *calls, "return value")


def map_index(function: Callable, count: tuple, *arguments: Any) -> tuple:
    """Return (function(*arguments, 0), function(*arguments, 1), ...), one entry for each entry of the tuple `count`."""
    return tuple(function(*arguments, i) for i in range(len(count)))


@overload_for(map_index)
def _map_index(function, count, *arguments):
    leading = "".join(f"arguments[{k}], " for k in range(len(arguments)))
    calls = "".join(f"function({leading}{i}), " for i in range(len(count)))
    return compile_source("map_index(function, count, *arguments)", {}, f"return ({calls})")
