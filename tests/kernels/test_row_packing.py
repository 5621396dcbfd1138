"""Trees as rows, and the columns of many rows."""

import gc
import math
import weakref
from typing import NamedTuple

import numpy as np
import pytest
from numba.core.errors import TypingError

from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.kernels import kernel
from lapwing.kernels.row_packing import columns, load, pack_row, row_unpacker, row_width, store


class Inner(NamedTuple):
    place: tuple[float, float, float]
    on: bool


class Tree(NamedTuple):
    time: float
    attitude: Quaternion
    inner: Inner
    several: tuple[tuple[float, float], ...]
    none: tuple[float, ...] = ()


LIKE = Tree(1.0, Quaternion(1.0, 0.0, 0.0, 0.0), Inner((2.0, 3.0, 4.0), True), ((5.0, 6.0), (7.0, 8.0)))


def test_columns_are_the_numbers_of_each_part():
    rows = np.stack([pack_row(LIKE), 10.0 * pack_row(LIKE)])
    assert rows.shape == (2, row_width(LIKE))
    found = columns(LIKE, rows)
    assert found.time.tolist() == [1.0, 10.0]
    assert found.attitude.shape == (2, 4)
    assert found.inner.place[1].tolist() == [20.0, 30.0, 40.0]
    assert found.inner.on.tolist() == [1.0, 10.0]
    assert [part.tolist() for part in found.several] == [[[5.0, 6.0], [50.0, 60.0]], [[7.0, 8.0], [70.0, 80.0]]]
    assert found.none.shape == (2, 0)


def test_a_row_is_read_as_the_tree_that_it_was_made_of():
    tree = LIKE._replace(time=0.1, inner=Inner((1e-300, -0.0, math.inf), False))
    read = row_unpacker(LIKE)(pack_row(tree))
    assert repr(read) == repr(tree)
    several = ((1, True), (2.5,), ())
    assert repr(row_unpacker(several)(pack_row(several))) == repr(several)
    assert row_unpacker(3)(pack_row(2**53)) == 2**53


@kernel
def _copied(like, rows, i, j):
    found = load(like, rows, i)
    store(found, rows, j)
    return found


class Counted(NamedTuple):
    number: int
    tree: Tree


@pytest.mark.parametrize("tree", [Counted(-7, LIKE), Counted(2**53, LIKE._replace(time=-0.0)), (2.5, (True, 3), ())])
def test_compiled_code_reads_and_writes_the_same_rows(tree):
    rows = np.stack([np.full(row_width(tree), math.nan), pack_row(tree), np.full(row_width(tree), 9.0)])
    found = _copied(tree, rows, 1, 2)
    assert repr(found) == repr(tree)
    assert rows[2].tobytes() == rows[1].tobytes()
    assert np.isnan(rows[0]).all()


def test_only_numbers_stand_in_rows():
    with pytest.raises(TypingError, match="a row holds numbers, tuples and NamedTuples only"):
        _copied((1.0, "text"), np.zeros((2, 2)), 0, 1)


def test_rows_are_let_go_with_their_columns():
    """Without the garbage collector, which commands run seldom: a page of rows is there no longer than it is used."""
    rows = np.stack([pack_row(LIKE)] * 3)
    gone = weakref.ref(rows)
    gc.disable()
    try:
        found = columns(LIKE, rows)
        del rows, found
        assert gone() is None
    finally:
        gc.enable()
