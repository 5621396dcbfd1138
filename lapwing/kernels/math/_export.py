"""Functions that run as plain Python when called from Python, and as a kernel of the same source in compiled code."""

# numba.core.types fills itself at import
# mypy: disable-error-code="attr-defined"

import inspect
from collections.abc import Callable
from functools import cache
from typing import Any

from numba.core import cgutils, types
from numba.core.typing.templates import AbstractTemplate, infer_global
from numba.extending import lower_builtin

from lapwing.kernels.compiler.code_libraries import PureLibrary
from lapwing.kernels.compiler.decorators import always_inline, python_function
from lapwing.kernels.compiler.pipeline import KernelDispatcher
from lapwing.kernels.math._vector_variants import PureFunction, vector_width


def export(kernel: Any, *, inline: bool = False, of_small: Any = None) -> Callable[..., Any]:
    """Return the plain Python function of a kernel of floats, which compiled code replaces by the kernel.

    Args:
        kernel: compiled function, inlined where it is called as a kernel.
        inline: True to inline its calls. Otherwise LLVM treats them as calls of a pure function: it moves and merges
            them like calls of the C library, and optimises the function once instead of at every call. Loops over it
            are vectorised in kernels with `vectorise_loops`.
        of_small: the same without a branch for one argument of magnitude up to `reduction.LARGEST`; None if the kernel
            has no branch.
    """
    plain: Callable[..., Any] = python_function(kernel)
    register_compiled(plain, kernel, inline=inline, of_small=of_small)
    return plain


def register_compiled(function: Callable[..., Any], kernel: Any, *, inline: bool = False, of_small: Any = None) -> None:
    """Register a kernel of floats as the compiled form of a function of numbers; see `export` for arguments."""
    if not hasattr(kernel, "py_func"):
        return  # NUMBA_DISABLE_JIT
    floats = (types.float64,) * len(inspect.signature(kernel.py_func).parameters)
    inner = always_inline(kernel.py_func)  # never called from Python, so it gets no Python entry point
    inline = inline or not isinstance(inner, KernelDispatcher)  # numba's own passes cannot declare pure functions
    small = None if inline or of_small is None else always_inline(of_small.py_func)

    class Implementation(AbstractTemplate):
        key = function

        def generic(self, args: tuple, kws: dict) -> Any:
            if kws or len(args) != len(floats) or not all(isinstance(a, types.Number | types.Boolean) for a in args):
                return None
            dispatcher = types.Dispatcher(inner)
            signature = dispatcher.get_call_type(self.context, floats, {})
            if small is not None:
                types.Dispatcher(small).get_call_type(self.context, floats, {})
            self._entry = dispatcher.get_overload(signature) if inline else function
            return signature

        def get_impl_key(self, sig: Any) -> Any:
            return self._entry

    infer_global(function, types.Function(Implementation))
    if inline:
        return
    symbol = f"lapwing.math.{kernel.py_func.__name__}"

    @cache
    def code(context: Any, pure: PureFunction) -> PureLibrary:
        """Return the code of the function and of its variant for vectors."""
        kernels = [dispatcher.overloads[floats] for dispatcher in (inner, small) if dispatcher is not None]
        library = PureLibrary(context.codegen(), pure.symbol)
        module = library.create_ir_module(pure.symbol)
        pure.define(context, module, kernels[0].fndesc)
        pure.define_variant(context, module, kernels[0].fndesc, kernels[1].fndesc if small is not None else None)
        for each in kernels:
            library.add_linking_library(each.library)
        library.add_ir_module(module)
        library.noinline = pure.symbol
        library.finalize()
        return library

    @lower_builtin(function, *floats)
    def _call(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        several = isinstance(sig.return_type, types.BaseTuple)
        width = vector_width(context.codegen().magic_tuple()[2])
        pure = PureFunction(symbol, len(floats), len(sig.return_type) if several else 1, width)
        context.add_linking_libs((code(context, pure),))
        result = builder.call(pure.declare(builder.module), args)
        if several:
            result = context.make_tuple(builder, sig.return_type, cgutils.unpack_tuple(builder, result))
        return result
