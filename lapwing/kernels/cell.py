"""Cells: mutable boxes that keep a state tree on the compiled side, so that Python does not rebuild it at every call.

Passing a NamedTuple of a hundred numbers to a compiled function takes ten microseconds, a cell less than one. Cells are
created, read and written without compilation (`lapwing.kernels.native_memory`).
"""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numba
from numba import types
from numba.experimental import structref

from lapwing.kernels.native_memory import Layout, Memory, layout
from lapwing.kernels.tree_flatten import Flattener, UnknownError, leaves, structure


@structref.register
class CellType(types.StructRef):
    """The numba type of a cell."""

    def preprocess_fields(self, fields):
        """Remove literal types, which would create a separate cell type for every constant."""
        return tuple((name, types.unliteral(of)) for name, of in fields)

    @property
    def key(self) -> Any:
        """Key of the type. Numba's own key is text that is equal for two classes with equal names and fields."""
        return self._fields

    def __hash__(self) -> int:
        if self._hash is None:  # types with hundreds of numbers are looked up often
            self._hash = super().__hash__()
        return self._hash

    def __getstate__(self) -> dict[str, Any]:
        """Return the state without the hash, which differs between processes."""
        return {name: value for name, value in vars(self).items() if name != "_hash"}

    _hash: int | None = None


@dataclass
class _Form:
    """Data shared by the cells of one structure."""

    kind: types.Type  # numba type of the value
    cell: CellType
    layout: Layout
    flattener: Flattener | None = None  # generated when a second cell of the structure is created


_forms: dict[Hashable, _Form] = {}  # by structure
_by_classes: dict[Hashable, list[_Form]] = {}  # by the top-level classes, for a fast lookup


def _form(value: Any) -> tuple[_Form, Sequence[Any]]:
    """Return the form of a cell for this value, and the leaves of the value."""
    top: Any = (type(value), *map(type, value)) if isinstance(value, tuple) else type(value)
    for form in _by_classes.get(top, ()):
        assert form.flattener is not None
        if (values := form.flattener.leaves(value)) is not None:
            return form, values
    try:
        key: Hashable = structure(value)
    except UnknownError:
        key = None
    existing = _forms.get(key)
    if existing is not None:
        existing.flattener = Flattener(value)
        _by_classes.setdefault(top, []).append(existing)
        return existing, leaves(value)
    kind = numba.typeof(value)
    form = _Form(kind, CellType([("value", kind)]), layout(kind))
    if key is not None:
        _forms[key] = form
    return form, leaves(value)


class Cell(structref.StructRefProxy):
    """A mutable box around one value: `cell.value` in compiled code.

    Attributes:
        memory: the native memory of the value.
    """

    memory: Memory

    def __new__(cls, value: Any) -> "Cell":
        """Return a cell that holds `value`: a number, array or cell, or a tuple or NamedTuple of these."""
        # numba's constructor would be compiled in every process for every type of value
        form, parts = _form(value)
        memory = Memory(form.kind, parts, form.layout)
        cell = cls._numba_box_(form.cell, memory.count)
        cell.memory = memory
        return cell


structref.define_boxing(CellType, Cell)


def read(cell: Cell) -> Any:
    """Return the value of a cell, with copies of its arrays."""
    return cell.memory.read()


def write(cell: Cell, value: Any) -> None:
    """Store a value of the same type in a cell.

    Raises:
        TypeError: the value has another type.
    """
    cell.memory.write(value)
