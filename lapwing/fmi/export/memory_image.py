"""Position-independent image of the memory that compiled blocks use.

Blocks reach all their data through pointers: cells, arrays, and the rows of ports. The image holds a copy of each
region, and the list of its pointers as offsets, so that C code can place it at any address.
"""

# numba.core.types fills itself at import
# mypy: disable-error-code="attr-defined,name-defined"

import ctypes
import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numba
import numpy as np
from numba.core import types

from lapwing.kernels.native_memory import ARRAY, layout

META = struct.Struct("<QQQQQQ")  # numba's MemInfo: count, destructor, its argument, data, size, allocator
META_SIZE, META_DATA = META.size, 24
COUNT = 1 << 40  # references: never released
ALIGNMENT = 16  # [bytes] alignment of regions
WORD = 8


class Leaf(NamedTuple):
    """A number in the image."""

    path: str  # block, "|", path in its `BlockData`: "plant|parameters.vehicle.mass"
    offset: int  # [bytes] position in the image
    kind: types.Type  # a numba scalar type
    owner: type | None  # NamedTuple class that has the field
    field: str  # name of that field


@dataclass
class Region:
    """A piece of memory in use by a block.

    Attributes:
        address: address in this process.
        size: [bytes]
        header: True if a MemInfo precedes the data.
        offset: position of the data in the image [bytes].
    """

    address: int
    size: int
    header: bool
    offset: int = 0


@dataclass
class MemoryImage:
    """Copy of the memory of several cells.

    Attributes:
        data: the bytes, with zeros at each pointer.
        relocations: (offset of a pointer, offset that it points to).
        cells: offset of the MemInfo of each root cell, in the order of `roots`.
        rows: offset of the first row of each port.
        leaves: the numbers in cells, by their paths.
        regions: the memory in this process, to compare it later.
    """

    data: bytearray
    relocations: list[tuple[int, int]]
    cells: list[int]
    rows: dict[str, int]
    leaves: list[Leaf]
    regions: list[Region] = field(default_factory=list)


def image_of(roots: Sequence[tuple[str, Any]], rows: Mapping[str, np.ndarray]) -> MemoryImage:
    """Return the image of cells and of the rows of ports.

    Args:
        roots: (name, `Cell` of `BlockData`) of each block.
        rows: rows of each port.

    Raises:
        ValueError: a value cannot be copied, such as an array of objects.
    """
    walk = _Walk()
    for name, array in rows.items():
        walk.array(array.ctypes.data, array.nbytes, name)
    for name, cell in roots:
        walk.root(name, cell)
    return walk.finish([cell for _, cell in roots], rows)


class _Pointer(NamedTuple):
    """A pointer found in a region."""

    at: int  # address of the pointer
    to: int  # address that it points to; of a MemInfo if `meta`
    meta: bool


class _Walk:
    """Search for all memory that is reachable from the cells."""

    def __init__(self) -> None:
        self._cells: dict[int, Region] = {}  # by address of the MemInfo
        self._arrays: list[tuple[int, int]] = []  # (first byte, byte after the last) of spans to merge
        self._pointers: list[_Pointer] = []
        self._cleared: list[int] = []  # addresses of words that are only valid in this process
        self._found: list[tuple[str, int, types.Type, type | None, str]] = []

    def root(self, name: str, cell: Any) -> None:
        """Walk the cell of a block."""
        self._cell(numba.typeof(cell), cell.memory.pointer, f"{name}|")

    def array(self, address: int, size: int, name: str) -> None:
        """Add the memory of an array."""
        if size:
            self._arrays.append((address, address + size))

    def _cell(self, kind: types.Type, meta: int, path: str) -> None:
        if meta in self._cells:
            return
        value = dict(kind._fields)["value"]
        data = ctypes.c_uint64.from_address(meta + META_DATA).value
        self._cells[meta] = Region(data, _size(value), True)
        self._value(value, data, path, None, "")

    def _value(self, kind: types.Type, at: int, path: str, owner: type | None, name: str) -> int:
        """Walk a value at address `at`. Return the address after it."""
        of = layout(kind)
        at = -(-at // of.alignment) * of.alignment
        if isinstance(kind, types.BaseTuple):
            for part, key, cls in _parts(kind):
                at = self._value(part, at, f"{path}{_step(path, key)}", cls or owner, key if cls else name)
            return -(-at // of.alignment) * of.alignment
        if isinstance(kind, types.StructRef):
            meta = ctypes.c_uint64.from_address(at).value
            self._pointers.append(_Pointer(at, meta, True))
            self._cell(kind, meta, path)
        elif isinstance(kind, types.Array):
            self._array_value(kind, at, path)
        elif isinstance(kind, types.NoneType):
            self._cleared.append(at)
        else:
            self._found.append((path, at, kind, owner, name))
        return at + struct.calcsize(of.format)

    def _array_value(self, kind: types.Array, at: int, path: str) -> None:
        if not isinstance(kind.dtype, types.Number | types.Boolean):
            raise ValueError(f"{path}: an array of {kind.dtype} cannot be exported; use an array of numbers")
        words = struct.unpack(f"<{ARRAY.upper().replace('P', 'Q').replace('Q', 'q')}{2 * kind.ndim}q", _bytes(at, kind))
        items, size, data = words[2:5]
        shape, strides = words[5 : 5 + kind.ndim], words[5 + kind.ndim :]
        self._cleared += [at, at + WORD]  # reference count and Python object
        if items:
            reach = [(n - 1) * step for n, step in zip(shape, strides, strict=True)]
            first = data + sum(min(0, r) for r in reach)
            self.array(first, data + size + sum(max(0, r) for r in reach) - first, path)
            self._pointers.append(_Pointer(at + 4 * WORD, data, False))
        else:
            self._cleared.append(at + 4 * WORD)

    def finish(self, roots: Sequence[Any], rows: Mapping[str, np.ndarray]) -> MemoryImage:
        """Assign offsets to the regions and copy them."""
        regions = [*self._cells.values(), *(Region(a, b - a, False) for a, b in _merge(self._arrays))]
        end = 0
        for region in regions:
            start = -(-end // ALIGNMENT) * ALIGNMENT
            region.offset = start + (META_SIZE if region.header else 0)
            end = region.offset + region.size
        image = MemoryImage(bytearray(-(-end // ALIGNMENT) * ALIGNMENT), [], [], {}, [], regions)
        places = _Places(regions)
        for region in regions:
            image.data[region.offset : region.offset + region.size] = ctypes.string_at(region.address, region.size)
            if region.header:
                META.pack_into(image.data, region.offset - META_SIZE, COUNT, 0, 0, 0, region.size, 0)
                image.relocations.append((region.offset - META_SIZE + META_DATA, region.offset))
        for address in self._cleared:
            offset = places[address]
            image.data[offset : offset + WORD] = bytes(WORD)
        for pointer in self._pointers:
            offset = places[pointer.at]
            image.data[offset : offset + WORD] = bytes(WORD)
            to = self._cells[pointer.to].offset - META_SIZE if pointer.meta else places[pointer.to]
            image.relocations.append((offset, to))
        image.cells = [self._cells[cell.memory.pointer].offset - META_SIZE for cell in roots]
        image.rows = {name: places[array.ctypes.data] for name, array in rows.items()}
        image.leaves = [Leaf(path, places[at], kind, cls, name) for path, at, kind, cls, name in self._found]
        return image


class _Places:
    """Conversion of addresses in this process to offsets in the image."""

    def __init__(self, regions: Sequence[Region]):
        self._regions = sorted(regions, key=lambda region: region.address)
        self._starts = [region.address for region in self._regions]

    def __getitem__(self, address: int) -> int:
        region = self._regions[int(np.searchsorted(self._starts, address, "right")) - 1]
        assert 0 <= address - region.address <= region.size
        return region.offset + address - region.address


def _parts(kind: types.BaseTuple) -> Iterator[tuple[types.Type, str, type | None]]:
    """Return type, name and NamedTuple class of each item."""
    if isinstance(kind, types.BaseNamedTuple):
        for name, part in zip(kind.fields, kind.types, strict=True):
            yield part, name, kind.instance_class
    else:
        for i, part in enumerate(kind.types):
            yield part, _class_name(kind, part) or str(i), None


def _class_name(kind: types.BaseTuple, part: types.Type) -> str:
    """Return the name of an item by its class, "ground_contact", in a tuple of different classes, else ""."""
    classes = [getattr(each, "instance_class", None) for each in kind.types]
    if None in classes or len(set(classes)) < len(classes):
        return ""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", part.instance_class.__name__).lower()


def _step(path: str, key: str) -> str:
    return f"[{key}]" if key.isdigit() else key if path.endswith("|") else f".{key}"


def _size(kind: types.Type) -> int:
    return struct.calcsize(layout(kind).format)


def _bytes(at: int, kind: types.Type) -> bytes:
    return ctypes.string_at(at, _size(kind))


def _merge(spans: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return the spans with overlapping ones joined."""
    result: list[tuple[int, int]] = []
    for first, end in sorted(spans):
        if result and first < result[-1][1]:
            result[-1] = result[-1][0], max(end, result[-1][1])
        else:
            result.append((first, end))
    return result
