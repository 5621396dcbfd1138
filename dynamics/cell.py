"""Cells keep a state tree on the compiled side, so that Python does not take it apart and rebuild it at every call.

Handing a NamedTuple of a hundred numbers to a compiled function costs ten microseconds, a cell less than one.
"""

from numba import types
from numba.experimental import structref

from dynamics.kernel import kernel


@structref.register
class CellType(types.StructRef):
    """Numba's type of a cell."""

    def preprocess_fields(self, fields):
        """Literal types would make a cell of one value a type of its own."""
        return tuple((name, types.unliteral(of)) for name, of in fields)


class Cell(structref.StructRefProxy):
    """A mutable box around one value: `cell.value` in compiled code."""

    def __new__(cls, value):
        """A cell that holds `value`."""
        return structref.StructRefProxy.__new__(cls, value)


structref.define_proxy(Cell, CellType, ["value"])


@kernel
def read(cell):
    """The value of a cell, as Python sees it."""
    return cell.value
