"""Cells keep a state tree on the compiled side, so that Python does not take it apart and rebuild it at every call.

Handing a NamedTuple of a hundred numbers to a compiled function costs ten microseconds, a cell less than one.
"""

from typing import Any

import numba
from numba import types
from numba.experimental import structref

from dynamics.kernel import kernel


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


class Cell(structref.StructRefProxy):
    """A mutable box around one value: `cell.value` in compiled code."""

    def __new__(cls, value: Any) -> "Cell":
        """A cell that holds `value`: a number, or a NamedTuple or tuple of such."""
        # Numba's own constructor would be compiled in every process, and a dispatcher takes a NamedTuple for another of
        # the same class name and types of fields.
        return _new.compile((numba.typeof(value),))(value)  # type: ignore[attr-defined]


structref.define_proxy(Cell, CellType, ["value"])


@kernel
def _new(value):
    return Cell(value)


@kernel
def read(cell):
    """The value of a cell, as Python sees it."""
    return cell.value


@kernel
def write(cell, value):
    """Give a cell another value, of the type of the one that it holds."""
    cell.value = value
