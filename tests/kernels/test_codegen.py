"""Functions compiled from text: equal in Python and compiled code, one for each combination of argument types."""

from numba.core import types

from lapwing.kernels import always_inline, kernel
from lapwing.kernels.codegen import compile_source, generic, map_index, map_tuple, reduce_tuple


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
