"""Kernels as Python functions: they accept numpy arrays and compile neither themselves nor called kernels."""

import numpy as np

from lapwing.kernels import always_inline, kernel, python_function


@always_inline
def doubled(x):
    return 2.0 * x


@always_inline
def raised(x):
    return doubled(x) + 1.0


@kernel
def outer(x):
    return raised(x) * doubled(x)


def test_python_function_compiles_no_kernel():
    python = python_function(outer)
    assert python(3.0) == 42.0
    np.testing.assert_array_equal(python(np.array([0.0, 3.0])), [0.0, 42.0])
    assert not any(function.signatures for function in (outer, raised, doubled))
    assert python_function(outer) is python


def test_python_function_equals_compiled_function():
    assert outer(0.1) == python_function(outer)(0.1)
