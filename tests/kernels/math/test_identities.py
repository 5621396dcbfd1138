"""Symmetries and identities of the elementary functions, bit for bit in compiled code and plain Python."""

import ast
import inspect
import math
import random
import re
from importlib import import_module

import pytest
from numba import types

from lapwing.kernels import kernel
from lapwing.kernels import math as functions
from lapwing.kernels.math import coefficients
from tests.kernels.math.accuracy import samples
from tests.kernels.math.kernels import KERNELS


def _values(low: float, high: float, count: int = 3000) -> list[float]:
    rng = random.Random(3)
    return [rng.uniform(low, high) for _ in range(count)]


@pytest.mark.parametrize("name", sorted(KERNELS.keys() - {"sincos"}))
def test_plain_python_is_bit_for_bit_identical(name):
    for arguments in samples(name, 300, seed=5):
        a, b = KERNELS[name](*arguments), getattr(functions, name)(*arguments)
        assert a == b or (a != a and b != b), arguments


@pytest.mark.parametrize("name", ["sin", "tan", "asin", "atan", "tanh", "cbrt"])
def test_odd_functions_are_odd(name):
    function = getattr(functions, name)
    for (x,) in samples(name, 500, seed=1):
        assert function(-x) == -function(x)


def test_sincos_equals_sin_and_cos():
    for (x,) in samples("sin", 500, seed=2):
        assert functions.sincos(x) == (functions.sin(x), functions.cos(x))


def test_sine_and_cosine_lie_on_unit_circle():
    for x in _values(-1e5, 1e5):
        s, c = functions.sincos(x)
        assert abs(functions.hypot(s, c) - 1.0) <= 2.3e-16


def test_angle_of_direction_is_angle():
    for x in _values(-3.14, 3.14):
        s, c = functions.sincos(x)
        assert functions.atan2(s, c) == pytest.approx(x, rel=4e-16, abs=1e-16)


def test_arc_sine_and_cosine_add_to_quarter_turn():
    for x in _values(-1.0, 1.0):
        assert functions.asin(x) + functions.acos(x) == pytest.approx(0.5 * math.pi, abs=4.5e-16)


def test_logarithm_inverts_exponential():
    for x in _values(-700.0, 700.0):
        assert functions.log(functions.exp(x)) == pytest.approx(x, rel=2.5e-16, abs=1.2e-16)
    for x in _values(-0.5, 700.0):
        assert functions.log1p(functions.expm1(x)) == pytest.approx(x, rel=5e-16)


@pytest.mark.parametrize("name", ["exp", "log", "atan", "tanh", "cbrt", "expm1", "log1p", "asin"])
def test_monotonic_functions_are_monotonic(name):
    function = getattr(functions, name)
    for x in _values(0.01, 0.99):
        y = math.nextafter(x, 1.0)
        assert function(y) >= function(x)


@pytest.mark.parametrize("name", KERNELS)
def test_machine_code_has_no_fma_and_no_library_call(name):
    kernel = KERNELS[name]
    kernel.compile((types.float64,) * len(inspect.signature(kernel.py_func).parameters))
    library = next(iter(kernel.overloads.values())).library
    text = library.codegen._tm.emit_assembly(library._get_module_for_linking())
    assert "retq" in text or "ret\n" in text
    assert not re.search(r"\bv?f(n?m(add|sub)|ma)\w*\b", text)
    called = set(re.findall(r"(?m)^\s*(?:callq?|jmp|bl|movabsq)[ \t]+\$?([A-Za-z_]\w*)", text))
    assert not {symbol for symbol in called if not symbol.startswith(("_ZN", "Py", "_Py", "NRT_", "numba_"))}


def test_length_accepts_any_number_of_coordinates():
    assert functions.hypot() == 0.0
    assert functions.hypot(-3.0) == 3.0
    assert functions.hypot(2.0, 3.0, 6.0) == 7.0
    assert functions.dist((1.0, 2.0), (4.0, 6.0)) == 5.0
    assert functions.hypot(math.nan, math.inf) == math.inf


def test_total_adds_in_order():
    assert functions.total(iter((1e16, 1.0, -1e16))) == 0.0
    assert functions.total([]) == 0.0


def test_functions_called_in_kernels_are_kernels():
    @kernel
    def length(x, y):
        return math.sqrt(functions.square(functions.hypot(x, 2)) + functions.square(functions.sin(y)))

    assert length(1.5, 0.5) == math.sqrt(2.5 * 2.5 + functions.sin(0.5) * functions.sin(0.5))


def test_tables_equal_output_of_script():
    assert coefficients.TARGET.read_text() == coefficients.text()


def test_sources_call_exact_functions_only():
    for module in (
        "_primitives",
        "exponential",
        "inverse_trigonometric",
        "logarithm",
        "reduction",
        "roots",
        "trigonometric",
    ):
        tree = ast.parse(inspect.getsource(import_module(f"lapwing.kernels.math.{module}")))
        used = {
            node.attr
            for node in ast.walk(tree)
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "math"
        }
        assert used <= {"sqrt", "inf", "nan"}
