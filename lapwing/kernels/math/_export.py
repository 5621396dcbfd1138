"""Functions that run as plain Python when called from Python, and as a kernel of the same source in compiled code."""

import inspect
from collections.abc import Callable
from functools import cache
from typing import Any

from llvmlite import ir
from numba.core import types
from numba.core.typing.templates import AbstractTemplate, infer_global
from numba.extending import lower_builtin

from lapwing.kernels.compiler.call_convention import ValueCallConv
from lapwing.kernels.compiler.code_libraries import InnerLibrary
from lapwing.kernels.compiler.decorators import always_inline, python_function
from lapwing.kernels.compiler.pipeline import KernelDispatcher

PURE = ("memory(none)", "nounwind", "willreturn", "noinline")


def export(kernel: Any, *, inline: bool = False) -> Callable[..., Any]:
    """Return the plain Python function of a kernel of floats, which compiled code replaces by the kernel.

    Args:
        kernel: compiled function, inlined where it is called as a kernel.
        inline: True to inline its calls. Otherwise LLVM treats them as calls of a pure function: it moves and merges
            them like calls of the C library, and optimises the function once instead of at every call.
    """
    plain: Callable[..., Any] = python_function(kernel)
    register_compiled(plain, kernel, inline=inline)
    return plain


def register_compiled(function: Callable[..., Any], kernel: Any, *, inline: bool = False) -> None:
    """Register a kernel of floats as the compiled form of a function of numbers; see `export` for arguments."""
    if not hasattr(kernel, "py_func"):
        return  # NUMBA_DISABLE_JIT
    floats = (types.float64,) * len(inspect.signature(kernel.py_func).parameters)
    inner = always_inline(kernel.py_func)  # never called from Python, so it gets no Python entry point
    inline = inline or not isinstance(inner, KernelDispatcher)  # numba's own passes cannot declare pure functions

    class Implementation(AbstractTemplate):
        key = function

        def generic(self, args: tuple, kws: dict) -> Any:
            if kws or len(args) != len(floats) or not all(isinstance(a, types.Number | types.Boolean) for a in args):
                return None
            dispatcher = types.Dispatcher(inner)
            signature = dispatcher.get_call_type(self.context, floats, {})
            self._entry = dispatcher.get_overload(signature) if inline else function
            return signature

        def get_impl_key(self, sig: Any) -> Any:
            return self._entry

    infer_global(function, types.Function(Implementation))
    if inline:
        return

    @cache
    def library(context: Any) -> InnerLibrary:
        return _pure_library(context, inner.overloads[floats], symbol)

    symbol = f"lapwing.math.{kernel.py_func.__name__}"

    @lower_builtin(function, *floats)
    def _call(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        context.add_linking_libs((library(context),))
        return builder.call(_declare(context, builder.module, symbol, sig.return_type, len(args)), args)


def _declare(context: Any, module: Any, symbol: str, returns: Any, count: int) -> Any:
    """Return the function of doubles of that name in a module."""
    if symbol in module.globals:
        return module.globals[symbol]
    kind = ir.FunctionType(context.get_value_type(returns), [ir.DoubleType()] * count)
    function = ir.Function(module, kind, symbol)
    for attribute in PURE:
        set.add(function.attributes, attribute)  # llvmlite rejects some of them as unknown
    return function


def _pure_library(context: Any, result: Any, symbol: str) -> InnerLibrary:
    """Return the library of a pure function that calls a compiled kernel, which raises nothing."""
    library = InnerLibrary(context.codegen(), symbol)
    module = library.create_ir_module(symbol)
    arguments = result.signature.args
    function = _declare(context, module, symbol, result.signature.return_type, len(arguments))
    builder = ir.IRBuilder(function.append_basic_block())
    convention = ValueCallConv(context)
    inner = convention.declare(module, result.fndesc)
    place, error = (builder.alloca(inner.args[k].type.pointee) for k in range(2))
    builder.call(inner, [place, error, *function.args])
    builder.ret(builder.load(place))
    library.add_linking_library(result.library)
    library.add_ir_module(module)
    library.apart = symbol
    library.finalize()
    return library
