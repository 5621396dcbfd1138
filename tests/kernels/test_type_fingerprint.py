"""Values have equal structures exactly if they have equal numba types."""

import itertools
from typing import NamedTuple

import numba
import numpy as np
import pytest

from lapwing.kernels.cell import Cell
from lapwing.kernels.tree_flatten import UnknownError, structure


class Pair(NamedTuple):
    x: float
    y: float


class Other(NamedTuple):
    x: float
    y: float


GRID = np.zeros((3, 4))
FROZEN = np.zeros((3, 4))
FROZEN.flags.writeable = False
VALUES = [
    1.0, 1, -(2**62), True, None, (), (1.0,), (1.0, 2), (1.0, 2.0), ((1.0, 2.0), 3.0), Pair(1.0, 2.0), Pair(1, 2.0),
    Other(1.0, 2.0), np.float64(2.0), np.float32(2.0), np.int64(2), np.int32(2), np.bool_(True),
    GRID, GRID.T, GRID[:, 1:], GRID[0], GRID.astype(np.int64), FROZEN, Cell(1.0), Cell(Pair(1.0, 2.0)),
    (Cell(1.0), GRID), (Cell(1), GRID),
]  # fmt: skip


def test_equal_structures_have_equal_types():
    for a, b in itertools.product(VALUES, VALUES):
        if structure(a) == structure(b):
            assert numba.typeof(a) == numba.typeof(b)
    assert structure(Pair(1.0, 2.0)) == structure(Pair(3.0, -np.inf))
    assert structure(GRID) == structure(np.ones((7, 2)))


def test_different_types_have_different_structures():
    for a, b in itertools.product(VALUES, VALUES):
        if numba.typeof(a) != numba.typeof(b):
            assert structure(a) != structure(b)


@pytest.mark.parametrize("value", ["text", [1.0], 2**63, object(), (1.0, ["list"])])
def test_unknown_values_raise_error(value):
    with pytest.raises(UnknownError):
        structure(value)


def test_integer_beyond_int64_is_uint64():
    assert numba.typeof(2**63) == numba.types.uint64
    for number in (1, 2, 2**63):  # a flattening function handles the second
        assert Cell(number).memory.read() == number
