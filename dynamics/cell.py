"""Cells keep a state tree on the compiled side, so that Python does not take it apart and rebuild it at every call.

Handing a NamedTuple of a hundred numbers to a compiled function costs ten microseconds, a cell less than one. Cells are
made, read and written without compiling anything (`dynamics.memory`).
"""

from collections.abc import Hashable
from typing import Any, NamedTuple

import numba
from numba import types
from numba.experimental import structref

from dynamics.memory import Layout, Memory, layout
from dynamics.structure import UnknownError, structure


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


class _Form(NamedTuple):
    """What cells of one structure share."""

    kind: types.Type  # of the value
    cell: CellType
    layout: Layout


_forms: dict[Hashable, _Form] = {}


def _form(value: Any) -> _Form:
    """That of a cell of this value."""
    try:
        key: Hashable = structure(value)
    except UnknownError:
        key = None
    found = _forms.get(key)
    if found is None:
        kind = numba.typeof(value)
        found = _Form(kind, CellType([("value", kind)]), layout(kind))
        if key is not None:
            _forms[key] = found
    return found


class Cell(structref.StructRefProxy):
    """A mutable box around one value: `cell.value` in compiled code.

    Attributes:
        memory: where compiled code has it.
    """

    memory: Memory

    def __new__(cls, value: Any) -> "Cell":
        """A cell that holds `value`: a number, an array or another cell, or a NamedTuple or tuple of such."""
        # numba's own constructor would be compiled in every process, and for every type of value
        form = _form(value)
        memory = Memory(form.kind, value, form.layout)
        cell = cls._numba_box_(form.cell, memory.count)
        cell.memory = memory
        return cell


structref.define_boxing(CellType, Cell)


def read(cell: Cell) -> Any:
    """The value of a cell, its arrays as copies."""
    return cell.memory.read()


def write(cell: Cell, value: Any) -> None:
    """Give a cell another value, of the type of the one that it holds.

    Raises:
        TypeError: it is of another type.
    """
    cell.memory.write(value)
