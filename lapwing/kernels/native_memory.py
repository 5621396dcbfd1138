"""Values in the memory layout of compiled code, written and read by Python without compilation.

Compiled code counts references to the memory of cells and arrays. Therefore each block of memory has a reference count
(numba's `MemInfo`) and holds one reference to each array and cell in it.
"""

# numba.core.types fills itself at import
# mypy: disable-error-code="attr-defined"

import ctypes
import struct
from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any, NamedTuple

import numba
import numpy as np
from numba.core import types
from numba.core.registry import cpu_target
from numba.core.runtime import _nrt_python as counted
from numba.core.runtime import rtsys
from numba.np.numpy_support import as_dtype

from lapwing.kernels.tree_flatten import leaves

ARRAY, CELL = "PPqqP", "P"  # fields of an array before shape and strides: count, owner, items, item size, address


class Layout(NamedTuple):
    """Memory layout of the values of a type."""

    format: str  # format of the module `struct`
    alignment: int  # [bytes]
    counted: tuple[int, ...]  # indices of the values in the format that point to reference counts
    values: int  # number of values
    leaves: int  # number of leaves of the value
    others: tuple[int, ...]  # indices of the leaves that are not numbers


@cache
def layout(kind: types.Type) -> Layout:
    """Return the layout of a numba type.

    Raises:
        TypeError: Python cannot write such a value.
    """
    if isinstance(kind, types.Boolean):
        return Layout("?", 1, (), 1, 1, ())
    if isinstance(kind, types.Integer):
        code = {8: "b", 16: "h", 32: "i", 64: "q"}[kind.bitwidth]
        return Layout(code if kind.signed else code.upper(), kind.bitwidth // 8, (), 1, 1, ())
    if isinstance(kind, types.Float):
        return Layout("d" if kind.bitwidth == 64 else "f", kind.bitwidth // 8, (), 1, 1, ())
    if isinstance(kind, types.NoneType):
        return Layout("P", 8, (), 1, 1, (0,))
    if isinstance(kind, types.StructRef):
        return Layout(CELL, 8, (0,), 1, 1, (0,))
    if isinstance(kind, types.Array):
        return Layout(f"{ARRAY}{2 * kind.ndim}q", 8, (0,), len(ARRAY) + 2 * kind.ndim, 1, (0,))
    if not isinstance(kind, types.BaseTuple):
        raise TypeError(f"expected numbers, arrays, tuples or NamedTuples for compiled code, got {kind}")
    parts = [layout(part) for part in kind]
    alignment = max((part.alignment for part in parts), default=1)
    align = {1: "", 2: "0h", 4: "0i", 8: "0q"}[alignment]
    pointers, others, values, leaves = [], [], 0, 0
    for part in parts:
        pointers += [values + i for i in part.counted]
        others += [leaves + i for i in part.others]
        values += part.values
        leaves += part.leaves
    written = align + "".join(part.format for part in parts) + align
    return Layout(written, alignment, tuple(pointers), values, leaves, tuple(others))


@cache
def _make_ready() -> None:
    """Initialise numba's reference counting."""
    rtsys.initialize(cpu_target.target_context)


class Memory:
    """The memory of one value of a numba type.

    Attributes:
        pointer: address of the reference count; compiled code identifies the memory by it.
        count: numba's object for the reference count, which keeps the memory alive.
    """

    def __init__(self, kind: types.Type, leaves: Sequence[Any], lies: Layout):
        """Store the leaves of a value of a type with this layout."""
        _make_ready()
        self._block = _Block(kind, lies, leaves)
        self.pointer: int = counted.meminfo_new(self._block.address, self._block)
        self.count = counted._MemInfo(self.pointer)

    def read(self) -> Any:
        """Return the value with copies of its arrays."""
        return _read(self._block.kind, iter(self._block.numbers()))

    def write(self, value: Any) -> None:
        """Store another value of the same type.

        Raises:
            TypeError: the value has another type.
        """
        if numba.typeof(value) != self._block.kind:
            raise TypeError(f"expected a value of type {self._block.kind}, got {numba.typeof(value)}")
        self._block.release()
        self._block.put(leaves(value))


class _Block:
    """Memory of one value, which releases its arrays and cells when compiled code releases the memory."""

    def __init__(self, kind: types.Type, lies: Layout, leaves: Sequence[Any]):
        self.kind, self._layout = kind, lies
        self._struct = struct.Struct(lies.format)
        self._place = (ctypes.c_int64 * (1 + self._struct.size // 8))()
        self.address = ctypes.addressof(self._place)
        self.put(leaves)

    def put(self, leaves: Sequence[Any]) -> None:
        """Write the leaves."""
        numbers = list(leaves)
        for k in reversed(self._layout.others):
            numbers[k : k + 1] = _in_memory(leaves[k])
        self._struct.pack_into(self._place, 0, *numbers)

    def numbers(self) -> tuple:
        """Return the current contents as a flat tuple."""
        return self._struct.unpack_from(self._place)

    def release(self) -> None:
        """Release the arrays and cells in the memory."""
        if self._layout.counted:
            numbers = self.numbers()
            for i in self._layout.counted:
                if numbers[i]:
                    counted._MemInfo(numbers[i])  # takes over the reference count and then ends
            self._place[:] = [0] * len(self._place)

    def __del__(self) -> None:
        self.release()


def _in_memory(leaf: Any) -> tuple[int, ...]:
    """Return the memory representation of an array, a cell or None."""
    if leaf is None:
        return (0,)
    if isinstance(leaf, np.ndarray):
        place = leaf.ctypes.data
        count = counted.meminfo_new(place, leaf)
        return count, id(leaf), leaf.size, leaf.itemsize, place, *leaf.shape, *leaf.strides
    leaf.memory.count.acquire()  # a cell's
    return (leaf.memory.pointer,)


def _read(kind: types.Type, numbers: Iterator[Any]) -> Any:
    if isinstance(kind, types.BaseTuple):
        parts = [_read(part, numbers) for part in kind.types]
        return kind.instance_class(*parts) if isinstance(kind, types.BaseNamedTuple) else tuple(parts)
    if isinstance(kind, types.Array):
        _, _, items, size, data, *extents = (next(numbers) for _ in range(layout(kind).values))
        place = (ctypes.c_char * (items * size)).from_address(data)
        shape, strides = extents[: kind.ndim], extents[kind.ndim :]
        return np.ndarray(shape, as_dtype(kind.dtype), place, strides=strides).copy()
    number = next(numbers)
    if isinstance(kind, types.StructRef):
        raise TypeError("a cell inside a cell cannot be read; read the inner cell instead")
    return None if isinstance(kind, types.NoneType) else number
