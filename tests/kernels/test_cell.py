"""Cells store a value, return it, and accept another of the same type and class."""

import struct
import weakref
from typing import NamedTuple

import numpy as np
import pytest
from numba import typeof
from numba.core import types
from numba.core.registry import cpu_target
from numba.core.runtime import _nrt_python, rtsys

from lapwing.kernels import kernel
from lapwing.kernels.cell import Cell, CellType, read, write
from lapwing.kernels.native_memory import layout


class Left:
    """Namespace."""

    class Pair(NamedTuple):
        """One of two classes with the same name and fields."""

        x: float
        inside: tuple[int, float]


class Right:
    """Another namespace."""

    class Pair(NamedTuple):
        """The other class."""

        x: float
        inside: tuple[int, float]


@pytest.mark.parametrize("value", [2.5, (1, 2.0), Left.Pair(1.0, (2, np.inf)), (), None])
def test_cell_returns_stored_value(value):
    assert read(Cell(value)) == value


def test_cell_accepts_another_value():
    cell = Cell(Left.Pair(1.0, (2, 3.0)))
    write(cell, Left.Pair(4.0, (5, 6.0)))
    assert read(cell) == Left.Pair(4.0, (5, 6.0))


def test_cell_distinguishes_classes_of_equal_name():
    for value in (Left.Pair(1.0, (2, 3.0)), Right.Pair(4.0, (5, 6.0))):
        assert type(read(Cell(value))) is type(value)


def test_cell_types_differ_for_classes_of_equal_name():
    left, right = (types.NamedTuple((types.float64, types.float64), cls) for cls in (Left.Pair, Right.Pair))
    assert CellType([("value", left)]) == CellType([("value", left)]) != CellType([("value", right)])


def test_pickled_type_has_no_hash_of_this_process():
    kind = CellType([("value", types.float64)])
    assert hash(kind) == hash(kind)
    assert hash(kind) not in kind.__getstate__().values()


class Mixed(NamedTuple):
    """All kinds of values in a cell, with gaps for alignment."""

    flag: bool
    inside: tuple[float, bool]
    other: bool
    count: int
    rows: np.ndarray
    nothing: None
    empty: tuple
    last: Left.Pair
    end: bool


def mixed(rows):
    return Mixed(True, (2.5, False), True, -7, rows, None, (), Left.Pair(1.0, (2, 3.0)), True)


def test_memory_layout_equals_layout_of_compiler():
    kind = typeof(mixed(np.zeros((2, 3))))
    context = cpu_target.target_context
    assert struct.calcsize(layout(kind).format) == context.get_abi_sizeof(context.get_value_type(kind))


@kernel
def change(cell):
    value = cell.value
    value.rows[1, 2] += value.last.inside[1]
    inside = (value.inside[0] * 2.0, value.inside[1])
    cell.value = Mixed(
        not value.flag, inside, value.other, value.count + 1, value.rows, value.nothing, (), value.last, value.end
    )


def test_compiled_code_reads_and_writes_cell():
    rows = np.arange(6.0).reshape(2, 3)
    cell = Cell(mixed(rows))
    change(cell)
    assert rows[1, 2] == 8.0
    result = read(cell)
    assert (result.rows == rows).all()
    assert result._replace(rows=None) == mixed(None)._replace(flag=False, inside=(5.0, False), count=-6)


class Holder(NamedTuple):
    """Cell in a cell."""

    inside: Cell


@kernel
def inner_value(cell):
    return cell.value.inside.value


@kernel
def with_new_rows(cell):
    cell.value = np.ones(1000)


def test_arrays_and_cells_live_while_referenced():
    rows = np.zeros(1000)
    gone = weakref.ref(rows)
    cell = Cell(rows)
    del rows
    assert gone() is not None
    with_new_rows(cell)
    assert gone() is None
    assert read(cell).sum() == 1000.0
    outer = Cell(Holder(cell))
    del cell
    assert inner_value(outer).sum() == 1000.0
    _nrt_python.memsys_enable_stats()
    before = rtsys.get_allocation_stats()
    for _ in range(3):
        cell = Cell(Holder(Cell(np.zeros(1000))))
        with_new_rows(Cell(np.zeros(1000)))
    del cell
    after = rtsys.get_allocation_stats()
    assert after.mi_alloc - after.mi_free == before.mi_alloc - before.mi_free


def test_cell_rejects_value_of_another_type():
    cell = Cell((1.0, 2.0))
    with pytest.raises(TypeError, match="expected a value of type"):
        write(cell, (1.0, 2))
    with pytest.raises(TypeError, match="numbers, arrays, tuples"):
        Cell("text")
