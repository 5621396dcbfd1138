"""Cells hold a value, give it back and take another of its type; what they hold is known by its class."""

from typing import NamedTuple

import numpy as np
import pytest
from numba.core import types

from dynamics.cell import Cell, CellType, read, write


class Left:
    """A namespace."""

    class Pair(NamedTuple):
        """One of two classes with the same name and fields."""

        x: float
        inside: tuple[int, float]


class Right:
    """A namespace."""

    class Pair(NamedTuple):
        """The other."""

        x: float
        inside: tuple[int, float]


@pytest.mark.parametrize("value", [2.5, (1, 2.0), Left.Pair(1.0, (2, np.inf)), (), None])
def test_gives_back_what_it_was_given(value):
    assert read(Cell(value)) == value


def test_takes_another_value():
    cell = Cell(Left.Pair(1.0, (2, 3.0)))
    write(cell, Left.Pair(4.0, (5, 6.0)))
    assert read(cell) == Left.Pair(4.0, (5, 6.0))


def test_holds_what_it_is_given_and_not_another_of_its_class_name():
    for value in (Left.Pair(1.0, (2, 3.0)), Right.Pair(4.0, (5, 6.0))):
        assert type(read(Cell(value))) is type(value)


def test_types_tell_classes_of_one_name_apart():
    left, right = (types.NamedTuple((types.float64, types.float64), cls) for cls in (Left.Pair, Right.Pair))
    assert CellType([("value", left)]) == CellType([("value", left)]) != CellType([("value", right)])
