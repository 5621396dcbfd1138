"""Calls of C functions at run-time addresses, and access to doubles at addresses, in compiled code."""

# numba.core.types fills itself at import
# mypy: disable-error-code="attr-defined"

import ctypes
import select
import struct
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

_INT32, _INT64, _DOUBLE = ir.IntType(32), ir.IntType(64), ir.DoubleType()


def address_of(function: Any) -> int:
    """Return the address of a ctypes function."""
    return ctypes.cast(function, ctypes.c_void_p).value or 0


def poll_entry(descriptor: int) -> np.ndarray:
    """Return the eight bytes of a `struct pollfd` that waits for input of a file."""
    return np.frombuffer(bytearray(struct.pack("=ihh", descriptor, select.POLLIN, 0)), np.int64)


def _caller(result: ir.Type) -> Callable:
    def call(typing_context: Any, address: types.Type, arguments: types.Type) -> tuple[Any, Callable]:
        kinds = [_DOUBLE if isinstance(each, types.Float) else _INT64 for each in arguments]
        converted = types.Tuple([types.float64 if isinstance(each, types.Float) else types.int64 for each in arguments])

        def generate(context: Any, builder: ir.IRBuilder, signature: Any, values: Sequence[ir.Value]) -> ir.Value:
            function = builder.inttoptr(values[0], ir.FunctionType(result, kinds).as_pointer())
            status = builder.call(function, [builder.extract_value(values[1], i) for i in range(len(kinds))])
            return status if result is _INT64 else builder.sext(status, _INT64)

        return types.int64(types.int64, converted), generate

    return call


call_int = intrinsic(_caller(_INT32))
"""(address, arguments) -> result of a C function that returns `int`; integers, pointers and doubles are arguments."""

call_long = intrinsic(_caller(_INT64))
"""(address, arguments) -> result of a C function that returns a number of 64 bits."""


@intrinsic
def load_double(typing_context: Any, address: types.Type) -> tuple[Any, Callable]:
    """Return the double at an address."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, values: Sequence[ir.Value]) -> ir.Value:
        return builder.load(builder.inttoptr(values[0], _DOUBLE.as_pointer()))

    return types.float64(types.int64), generate


@intrinsic
def store_double(typing_context: Any, address: types.Type, value: types.Type) -> tuple[Any, Callable]:
    """Store a double at an address."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, values: Sequence[ir.Value]) -> ir.Value:
        builder.store(values[1], builder.inttoptr(values[0], _DOUBLE.as_pointer()))
        return context.get_dummy_value()

    return types.void(types.int64, types.float64), generate
