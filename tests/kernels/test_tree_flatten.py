"""Flatteners for one structure: they flatten its values and reject others."""

import itertools

import numpy as np

from lapwing.kernels.cell import Cell
from lapwing.kernels.tree_flatten import Flattener, leaves, structure
from tests.kernels.test_type_fingerprint import VALUES

NESTED = [(a, (b, (), a)) for a, b in itertools.product(VALUES, VALUES)]


def test_flatten_accepts_its_structure_only():
    for a, b in itertools.product(VALUES, VALUES):
        result = Flattener(a).leaves(b)
        assert (result is not None) == (structure(a) == structure(b))
        assert result is None or all(map(same, result, leaves(b)))


def test_flattener_equals_recursive_flattening():
    for value in NESTED:
        result, expected = Flattener(value).leaves(value), leaves(value)
        assert len(result) == len(expected)
        assert all(map(same, result, expected))


def test_integer_beyond_int64_is_another_structure():
    assert Flattener((1, 2.0)).leaves((2**62, 2.0)) == (2**62, 2.0)
    assert Flattener((1, 2.0)).leaves((2**63, 2.0)) is None
    assert Flattener((1, 2.0)).leaves(("text", 2.0)) is None


def test_cells_of_equal_structure_hold_separate_values():
    grid = np.arange(6.0).reshape(2, 3)
    for k in range(4):  # the first recursively, the others by a generated function
        kept = Cell(0.5 * k)
        held = Cell((k, (0.5 * k, k > 1), grid + k, kept, None)).memory
        numbers = held._block.numbers()
        assert numbers[:3] == (k, 0.5 * k, k > 1)
        assert kept.memory.pointer in numbers


def same(a, b):
    return a is b
