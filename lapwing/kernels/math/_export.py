"""Functions that are plain Python when Python calls them, and the kernel of the same source in compiled code."""

import inspect
from collections.abc import Callable
from typing import Any

from numba.core import types
from numba.core.typing.templates import AbstractTemplate, infer_global

from lapwing.kernels.compiler.decorators import python_function


def exported(kernel: Any) -> Callable[..., Any]:
    """Return the plain Python function of a kernel of floats, which stands for the kernel in compiled code."""
    plain: Callable[..., Any] = python_function(kernel)
    compiled_as(plain, kernel)
    return plain


def compiled_as(function: Callable[..., Any], kernel: Any) -> None:
    """Let a function of numbers be a kernel of floats in compiled code."""
    if not hasattr(kernel, "py_func"):
        return  # NUMBA_DISABLE_JIT
    floats = (types.float64,) * len(inspect.signature(kernel.py_func).parameters)

    class Implementation(AbstractTemplate):
        key = function

        def generic(self, args: tuple, kws: dict) -> Any:
            if kws or len(args) != len(floats) or not all(isinstance(a, types.Number | types.Boolean) for a in args):
                return None
            dispatcher = types.Dispatcher(kernel)
            signature = dispatcher.get_call_type(self.context, floats, {})
            self._entry = dispatcher.get_overload(signature)
            return signature

        def get_impl_key(self, sig: Any) -> Any:
            return self._entry

    infer_global(function, types.Function(Implementation))
