"""Loops over elementary functions are vectorised and equal the functions bit for bit."""

import math
import re

import numpy as np
import pytest
from numba.core.registry import cpu_target

from lapwing.kernels import math as functions
from lapwing.kernels import vectorise_loops
from lapwing.kernels.math._vector_variants import vector_width
from tests.kernels.math.accuracy import samples
from tests.kernels.math.kernels import KERNELS

ODD = (0.0, -0.0, math.inf, -math.inf, math.nan, 5e-324, -1e-310, 1e300, -65536.0, math.nextafter(65536.0, 1e9), 1e22)
PAIRS = ("atan2", "hypot", "pow")


def _loop(name):
    function = getattr(functions, name)
    if name in PAIRS:

        @vectorise_loops
        def loop(result, x, y):
            for i in range(x.size):
                result[i] = function(x[i], y[i])
    elif name == "sincos":

        @vectorise_loops
        def loop(result, x, y):
            for i in range(x.size):
                result[i], y[i] = function(x[i])
    else:

        @vectorise_loops
        def loop(result, x, y):
            for i in range(x.size):
                result[i] = function(x[i])

    return loop


def _arguments(name):
    """Return common arguments, and vectors with one odd argument among common ones."""
    rows = list(samples("sin" if name == "sincos" else name, 400, seed=9))
    for k, odd in enumerate(ODD):
        rows[8 * k + k % 8] = (odd,) * len(rows[0])
    return [np.array(column) for column in zip(*rows, strict=True)]


@pytest.mark.parametrize("name", sorted(KERNELS))
def test_loop_equals_function_bit_for_bit(name):
    x, *y = _arguments(name)
    result, second = np.empty_like(x), np.array(y[0]) if y else np.empty_like(x)
    _loop(name)(result, x, second)
    expected = [
        getattr(functions, name)(*row) for row in zip(x.tolist(), *(column.tolist() for column in y), strict=True)
    ]
    if name == "sincos":
        expected, cosines = zip(*expected, strict=True)
        np.testing.assert_array_equal(second, cosines)
    np.testing.assert_array_equal(result, expected)
    assert np.array_equal(np.signbit(result), np.signbit(expected)) or np.isnan(expected).any()


@pytest.mark.skipif(
    vector_width(cpu_target.target_context.codegen().magic_tuple()[2]) < 4, reason="vectors of two are not faster"
)
@pytest.mark.parametrize("name", sorted(KERNELS))
def test_loop_is_vectorised(name):
    loop = _loop(name)
    loop(np.empty(9), np.full(9, 0.5), np.full(9, 0.5))
    (result,) = loop.overloads.values()
    bodies = re.split(r"(?m)^define ", str(result.library._get_module_for_linking()))
    own = [body for body in bodies if f"lapwing.math.{name}" in body or "loop" in body.partition("(")[0]]
    assert any(re.search(r"fmul <[48] x double>", body) for body in own)
