"""Cells keep a state tree on the compiled side, so that Python does not take it apart and rebuild it at every call.

Handing a NamedTuple of a hundred numbers to a compiled function costs ten microseconds, a cell less than one. Cells are
made, read and written without compiling anything (`lapwing.kernels.native_memory`).
"""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numba
from numba import types
from numba.experimental import structref

from lapwing.kernels.native_memory import Layout, Memory, layout
from lapwing.kernels.tree_flatten import Flattener, leaves
from lapwing.kernels.type_fingerprint import UnknownError, structure


@structref.register
class CellType(types.StructRef):
    """Numba's type of a cell."""

    def preprocess_fields(self, fields):
        """Literal types would make a cell of one value a type of its own."""
        return tuple((name, types.unliteral(of)) for name, of in fields)

    @property
    def key(self) -> Any:
        """Numba's own is text in which two classes of one name and fields are the same."""
        return self._fields

    def __hash__(self) -> int:
        if self._hash is None:  # a type of hundreds of numbers is looked up again and again
            self._hash = super().__hash__()
        return self._hash

    def __getstate__(self) -> dict[str, Any]:
        """Without the hash, which is another one in every process."""
        return {name: value for name, value in vars(self).items() if name != "_hash"}

    _hash: int | None = None


@dataclass
class _Form:
    """Data shared by the cells of one structure."""

    kind: types.Type  # of the value
    cell: CellType
    layout: Layout
    flattener: Flattener | None = None  # once there is more than one such cell: it is written for them


_forms: dict[Hashable, _Form] = {}  # by structure
_by_classes: dict[Hashable, list[_Form]] = {}  # by the classes at the top, which are found at once


def _form(value: Any) -> tuple[_Form, Sequence[Any]]:
    """Return the form of a cell of this value, and the leaves of the value."""
    top: Any = (type(value), *map(type, value)) if isinstance(value, tuple) else type(value)
    for form in _by_classes.get(top, ()):
        assert form.flattener is not None
        if (found := form.flattener.leaves(value)) is not None:
            return form, found
    try:
        key: Hashable = structure(value)
    except UnknownError:
        key = None
    known = _forms.get(key)
    if known is not None:
        known.flattener = Flattener(value)
        _by_classes.setdefault(top, []).append(known)
        return known, leaves(value)
    kind = numba.typeof(value)
    form = _Form(kind, CellType([("value", kind)]), layout(kind))
    if key is not None:
        _forms[key] = form
    return form, leaves(value)


class Cell(structref.StructRefProxy):
    """A mutable box around one value: `cell.value` in compiled code.

    Attributes:
        memory: where compiled code has it.
    """

    memory: Memory

    def __new__(cls, value: Any) -> "Cell":
        """Return a cell that holds `value`: a number, array or cell, or a tuple or NamedTuple of these."""
        # numba's own constructor would be compiled in every process, and for every type of value
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
    """Give a cell another value, of the type of the one that it holds.

    Raises:
        TypeError: it is of another type.
    """
    cell.memory.write(value)
