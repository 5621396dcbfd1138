"""Functions whose source is written for the types of their arguments: straight-line code instead of loops over tuples.

A kernel can neither index a tuple of unlike members by a variable nor choose a function by a class; such calls are
written out as text when it is compiled, and cost nothing when it runs. All text that `dynamics` runs as code is here.
"""

import inspect
from collections.abc import Callable, Mapping
from typing import Any

import numba
from numba.core import types
from numba.core.targetconfig import ConfigStack
from numba.core.typing.templates import AbstractTemplate, infer_global

from lapwing.kernels import uncached


def compile_source(signature: str, names: Mapping[str, Any], *lines: str) -> Callable:
    """A function from source text.

    Args:
        signature: "name(arguments)".
        names: what the body may refer to.
        lines: of the body.
    """
    scope = dict(names)
    exec("\n    ".join([f"def {signature}:", *lines]), scope)
    return scope[signature.partition("(")[0]]


def generated_overload(
    signature: str, generate: Callable[..., Callable], doc: str, *, inline: bool = False
) -> Callable:
    """A function for compiled code that `generate` makes anew for every combination of argument types.

    Called from Python, the same generated code runs uncompiled: slow, for tests and set-up.

    Args:
        signature: "name(arguments)".
        generate: takes the numba types of the arguments, returns a function of that signature.
        doc: its docstring.
        inline: always into its caller.
    """
    name = signature.partition("(")[0]

    def function(*values: Any) -> Any:
        return generate(*map(numba.typeof, values))(*values)

    function.__name__, function.__qualname__, function.__doc__ = name, name, doc
    function.__module__ = generate.__module__
    _implement(function, generate, inline)
    return function


def overload_for(function: Callable, *, inline: bool = False) -> Callable[[Callable[..., Callable]], Callable]:
    """Decorates what takes the numba types of a function's arguments and gives its implementation in compiled code.

    That is a function of the same arguments, or better, where there is one, a kernel: nothing more to compile.

    Args:
        function: what stands in the source of kernels; it is not called in them.
        inline: always into its caller, where a kernel does not say itself whether it is.
    """

    def decorate(choose: Callable[..., Callable]) -> Callable:
        _implement(function, choose, inline)
        return choose

    return decorate


def _implement(function: Callable, choose: Callable[..., Any], inline: bool) -> None:
    chosen: dict[tuple, Any] = {}

    class Implementation(AbstractTemplate):
        key = function

        def generic(self, args: tuple, kws: dict) -> Any:
            if kws:
                args = inspect.signature(function).bind(*args, **kws).args
            flags = ConfigStack().top().copy()
            flags.forceinline = flags.forceinline or inline
            if (args, flags.forceinline) not in chosen:
                chosen[args, flags.forceinline] = uncached(choose(*args))
            kernel = types.Dispatcher(chosen[args, flags.forceinline])
            with ConfigStack().enter(flags):
                signature = kernel.get_call_type(self.context, args, {})
            self._entry = kernel.get_overload(signature)
            return signature

        def get_impl_key(self, sig: Any) -> Any:
            return self._entry

    infer_global(function, types.Function(Implementation))


def map_tuple(function: Callable, common: Any, a: tuple, b: tuple) -> tuple:
    """(function(common, a[0], b[0]), function(common, a[1], b[1]), ...) for tuples of equal length."""
    return tuple(function(common, x, y) for x, y in zip(a, b, strict=True))


@overload_for(map_tuple, inline=True)
def _map_tuple(function, common, a, b):
    calls = "".join(f"function(common, a[{i}], b[{i}]), " for i in range(len(a)))
    return compile_source("map_tuple(function, common, a, b)", {}, f"return ({calls})")


def reduce_tuple(function: Callable, common: Any, value: Any, a: tuple, b: tuple) -> Any:
    """The value after value = function(common, value, a[0], b[0]), then with a[1] and b[1], and so on."""
    for x, y in zip(a, b, strict=True):
        value = function(common, value, x, y)
    return value


@overload_for(reduce_tuple, inline=True)
def _reduce_tuple(function, common, value, a, b):
    calls = [f"value = function(common, value, a[{i}], b[{i}])" for i in range(len(a))]
    return compile_source("reduce_tuple(function, common, value, a, b)", {}, *calls, "return value")


def any_in_tuple(found: tuple) -> bool:
    """Return True if any entry of a tuple is true."""
    return any(found)


@overload_for(any_in_tuple, inline=True)
def _any_in_tuple(found):
    return compile_source(
        "any_in_tuple(found)", {}, f"return {' or '.join(f'found[{i}]' for i in range(len(found))) or 'False'}"
    )


def map_index(function: Callable, count: tuple, *arguments: Any) -> tuple:
    """(function(*arguments, 0), function(*arguments, 1), ...), one for each entry of the tuple `count`."""
    return tuple(function(*arguments, i) for i in range(len(count)))


@overload_for(map_index)
def _map_index(function, count, *arguments):
    given = "".join(f"arguments[{k}], " for k in range(len(arguments)))
    calls = "".join(f"function({given}{i}), " for i in range(len(count)))
    return compile_source("map_index(function, count, *arguments)", {}, f"return ({calls})")
