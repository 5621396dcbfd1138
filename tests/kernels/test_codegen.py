"""Functions compiled from text: equal in Python and compiled code, one for each combination of argument types."""

from typing import NamedTuple

import pytest
from numba.core import types

from lapwing.kernels import DispatchTable, always_inline, kernel
from lapwing.kernels.codegen import compile_source, dispatch, generic, map_index, map_tuple, reduce_tuple


@always_inline
def weighted(k, x, y):
    return k * x + y


@always_inline
def item_difference(x, y, i):
    return x[i] - y[i]


@generic()
def first(x):
    """Return the first number."""
    return compile_source("first(x)", {}, "return x[0]" if isinstance(x, types.BaseTuple) else "return x")


@kernel
def all_of(x, y):
    return map_tuple(weighted, 2.0, x, y), map_index(item_difference, x, x, y), first(x), first(x[1])


def test_source_may_have_several_lines():
    assert compile_source("f(a, b)", {"one": 1}, "c = a + one", "return c * b")(2, 3) == 9


def test_compiled_code_equals_plain_python():
    x, y = (1.0, 2.0, 3.0), (4.0, 5.0, 6.0)
    assert all_of(x, y) == all_of.py_func(x, y) == ((6.0, 9.0, 12.0), (-3.0, -3.0, -3.0), 1.0, 2.0)
    assert (first.__name__, first.__doc__) == ("first", "Return the first number.")


@always_inline
def appended(common, value, x, y):
    return common * value + x * y


@kernel
def folded(x, y):
    return reduce_tuple(appended, 10.0, 1.0, x, y)


def test_reduce_tuple_keeps_order():
    x, y = (1.0, 2.0, 3.0), (1.0, 1.0, 2.0)
    assert folded(x, y) == folded.py_func(x, y) == 1126.0


class Spring(NamedTuple):
    stiffness: float


class Cable(NamedTuple):
    force: float


@always_inline
def pull(p, x):
    return p.stiffness * x


@always_inline
def constant(p, x):
    return p.force


PULLS = DispatchTable("pull")
PULLS[Cable] = constant
pull_of = dispatch(PULLS)


@kernel
def pulls(spring, cable, x):
    return pull_of(spring, x), pull_of(cable, x)


def test_function_of_module_is_called_for_class_without_entry():
    arguments = Spring(3.0), Cable(5.0), 2.0
    assert pulls(*arguments) == pulls.py_func(*arguments) == (6.0, 5.0)


def test_class_without_function_has_no_entry():
    missing = DispatchTable("push")
    assert missing.get(Spring) is None
    assert Spring not in PULLS
    assert pull_of.__module__ == __name__
    with pytest.raises(KeyError, match="test_codegen has no push"):
        missing[Spring]
