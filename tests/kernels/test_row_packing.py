"""Trees as rows, and columns of many rows."""

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


def test_columns_are_numbers_of_each_part():
    rows = np.stack([pack_row(LIKE), 10.0 * pack_row(LIKE)])
    assert rows.shape == (2, row_width(LIKE))
    result = columns(LIKE, rows)
    assert result.time.tolist() == [1.0, 10.0]
    assert result.attitude.shape == (2, 4)
    assert result.inner.place[1].tolist() == [20.0, 30.0, 40.0]
    assert result.inner.on.tolist() == [1.0, 10.0]
    assert [part.tolist() for part in result.several] == [[[5.0, 6.0], [50.0, 60.0]], [[7.0, 8.0], [70.0, 80.0]]]
    assert result.none.shape == (2, 0)


def test_row_restores_its_tree():
    tree = LIKE._replace(time=0.1, inner=Inner((1e-300, -0.0, math.inf), False))
    read = row_unpacker(LIKE)(pack_row(tree))
    assert repr(read) == repr(tree)
    several = ((1, True), (2.5,), ())
    assert repr(row_unpacker(several)(pack_row(several))) == repr(several)
    assert row_unpacker(3)(pack_row(2**53)) == 2**53


@kernel
def _copied(like, rows, i, j):
    result = load(like, rows, i)
    store(result, rows, j)
    return result


class Counted(NamedTuple):
    number: int
    tree: Tree


@pytest.mark.parametrize("tree", [Counted(-7, LIKE), Counted(2**53, LIKE._replace(time=-0.0)), (2.5, (True, 3), ())])
def test_compiled_code_reads_and_writes_same_rows(tree):
    rows = np.stack([np.full(row_width(tree), math.nan), pack_row(tree), np.full(row_width(tree), 9.0)])
    result = _copied(tree, rows, 1, 2)
    assert repr(result) == repr(tree)
    assert rows[2].tobytes() == rows[1].tobytes()
    assert np.isnan(rows[0]).all()


def test_rows_accept_numbers_only():
    with pytest.raises(TypingError, match="in a row"):
        _copied((1.0, "text"), np.zeros((2, 2)), 0, 1)


def test_rows_are_released_with_their_columns():
    """Release the rows without the garbage collector, which commands rarely run."""
    rows = np.stack([pack_row(LIKE)] * 3)
    gone = weakref.ref(rows)
    gc.disable()
    try:
        result = columns(LIKE, rows)
        del rows, result
        assert gone() is None
    finally:
        gc.enable()
