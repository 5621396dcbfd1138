"""Kernels pass tuples whole; numba's default convention for special functions still works."""

import numpy as np
import pytest

from lapwing.kernels import kernel, noinline
from lapwing.kernels.codegen import map_index


@kernel
def pair(flag, inside, *more):
    return (not flag, (inside[1], inside[0]), more)


@kernel
def through_pair(flag, inside, one, two):
    return pair(flag, inside, one), pair(flag, inside, one, two)


def test_booleans_nested_tuples_and_star_arguments_are_passed():
    inside, one, two = (1.0, (2, True)), (3.0,), (4.0,)
    swapped = (False, ((2, True), 1.0))
    assert through_pair(True, inside, one, two) == ((*swapped, (one,)), (*swapped, (one, two)))


@kernel
def indexed(table, i):
    return table[i]


@kernel
def with_single_table(table):
    return map_index(indexed, (0.0, 0.0), table)


def test_tuple_arguments_may_have_equal_length():
    assert with_single_table(((1.0, 2.0), (3.0, 4.0))) == ((1.0, 2.0), (3.0, 4.0))


@kernel
def factorial(n):
    return 1 if n < 2 else n * factorial(n - 1)


@kernel
def root_or_none(x):
    if x < 0.0:
        return None
    return np.sqrt(x)


@kernel
def counting(n):
    i = 0
    while i < n:
        yield i
        i += 1


@kernel
def checked(rows, i):
    if i >= len(rows):
        raise IndexError("no such row")
    return rows[i]


@kernel
def special(n, x, rows):
    total = 0
    for i in counting(n):
        total += i
    root = root_or_none(x)
    return factorial(n), -1.0 if root is None else root, total, checked(rows, n)


@kernel
def caught(rows, i):
    try:
        return checked(rows, i)
    except Exception:
        return -1.0


def test_unsupported_functions_use_default_compilation():
    rows = np.arange(6.0)
    assert special(4, 9.0, rows) == (24, 3.0, 6, 4.0)
    assert special(4, -9.0, rows) == (24, -1.0, 6, 4.0)
    with pytest.raises(IndexError, match="no such row"):
        special(7, 1.0, rows)
    assert (caught(rows, 2), caught(rows, 7)) == (2.0, -1.0)


@noinline
def cubed(x):
    if x < 0.0:
        raise ValueError("below zero")
    return x * x * x


@noinline
def of_cubes(a):
    return cubed(a[0]) + cubed(a[1])


@kernel
def both(a):
    return of_cubes(a) + cubed(a[0])


@kernel
def twice_both(a):
    return 2.0 * both(a)


def defined(library):
    return {f.name for f in library._get_module_for_linking().functions if not f.is_declaration}


def test_noinline_function_is_linked_into_outermost_kernel_only():
    twice_both._cache.disable()  # kernels from the disk have no inner kernels
    assert twice_both((2.0, 3.0)) == 2.0 * (8.0 + 27.0 + 8.0)
    (inner,) = (result.library for result in both.overloads.values())
    assert len(inner._noinline) == 2
    assert not defined(inner) & inner._noinline.keys()
    (outer,) = (result.library for result in twice_both.overloads.values())
    assert defined(outer) >= inner._noinline.keys()
    with pytest.raises(ValueError, match="below zero"):
        twice_both((2.0, -3.0))


@kernel
def entry(table, i, doubled):
    return 2.0 * table[i] if doubled else table[i]


@kernel
def entries(table, i):
    return entry(table, 0, True), entry(table, 1, False), entry(table, -1, doubled=True), entry(table, i, i > 0)


def test_constant_arguments_add_no_versions():
    entries._cache.disable()  # kernels from the disk have no inner kernels
    assert entries((1.0, 2.0, 3.0), 1) == (2.0, 2.0, 6.0, 4.0)
    assert len(entry.overloads) == 1
