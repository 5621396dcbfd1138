"""Double-double numbers and their elementary functions, against arithmetic of 50 digits."""

import math
import random
from operator import add, mul, sub, truediv

import mpmath
import numpy as np
import pytest

from lapwing.studies.accuracy.double_double import DoubleDouble, number
from lapwing.studies.accuracy.double_double_math import FUNCTIONS

BOUND = 1e-30  # relative error; a double has 1.1e-16
RANGES = {
    "sin": (-50.0, 50.0), "cos": (-50.0, 50.0), "tan": (-50.0, 50.0), "asin": (-1.0, 1.0), "acos": (-1.0, 1.0),
    "atan": (-9.0, 9.0), "exp": (-90.0, 90.0), "expm1": (-3.0, 3.0), "log": (1e-9, 9.0), "log1p": (-0.9, 9.0),
    "sqrt": (0.0, 90.0), "cbrt": (-90.0, 90.0), "tanh": (-9.0, 9.0), "atan2": (-9.0, 9.0), "hypot": (-9.0, 9.0),
    "pow": (0.01, 9.0),
}  # fmt: skip
PAIRS = ("atan2", "hypot", "pow")


def exact_value(name: str, *x: mpmath.mpf) -> mpmath.mpf:
    if name == "cbrt":  # mpmath's is the principal one
        return mpmath.sign(x[0]) * mpmath.cbrt(abs(x[0]))
    return getattr(mpmath, "power" if name == "pow" else name)(*x)


def digits(x: DoubleDouble) -> mpmath.mpf:
    return mpmath.mpf(x.high) + mpmath.mpf(x.low)


def random_number(rng: random.Random, low: float, high: float) -> DoubleDouble:
    return number(rng.uniform(low, high)) + rng.uniform(-1e-17, 1e-17)


def relative_error(value: DoubleDouble, exact: mpmath.mpf) -> float:
    return float(abs(digits(value) - exact) / abs(exact))


@pytest.mark.parametrize("operation", [add, sub, mul, truediv])
def test_arithmetic_has_digits(operation) -> None:
    rng = random.Random(1)
    with mpmath.workdps(50):
        for _ in range(500):
            x, y = (random_number(rng, -9.0, 9.0) * 10.0 ** rng.randint(-5, 5) for _ in range(2))
            exact = operation(digits(x), digits(y))
            scale = abs(digits(x)) + abs(digits(y)) if operation in (add, sub) else abs(exact)
            assert abs(digits(operation(x, y)) - exact) < 1e-31 * scale


@pytest.mark.parametrize("name", RANGES)
def test_function_has_digits(name: str) -> None:
    rng = random.Random(2)
    with mpmath.workdps(50):
        for _ in range(100):
            values = [random_number(rng, *RANGES[name]) for _ in range(2 if name in PAIRS else 1)]
            exact = exact_value(name, *map(digits, values))
            condition = 100.0 if name in ("sin", "cos", "tan", "asin", "acos", "pow", "exp") else 1.0
            assert relative_error(FUNCTIONS[name](*values), exact) < condition * BOUND


@pytest.mark.parametrize("name", ["expm1", "log1p", "sin", "tanh", "atan", "asin", "cbrt"])
@pytest.mark.parametrize("x", [1e-3, -1e-9, 1e-20])
def test_function_is_accurate_near_zero(name: str, x: float) -> None:
    with mpmath.workdps(60):
        assert relative_error(FUNCTIONS[name](x), exact_value(name, mpmath.mpf(x))) < BOUND


def test_logarithm_is_accurate_near_one() -> None:
    x = DoubleDouble(1.0, 1e-20)
    with mpmath.workdps(60):
        assert relative_error(FUNCTIONS["log"](x), mpmath.log(digits(x))) < BOUND


@pytest.mark.parametrize("left", [2.0, 2, np.float64(2.0)])
def test_number_on_the_left_leaves_operation_to_class(left) -> None:
    third = number(1) / 3
    for value in (left * third, left + third, left - third, left / third):
        assert isinstance(value, DoubleDouble)
    assert (left > third, left < third, left - 2 == third * 0) == (True, False, True)


def test_array_keeps_numbers() -> None:
    row = np.array([number(1) / 3, number(-2)], object)
    assert all(isinstance(x, DoubleDouble) for x in np.abs(1.0 - row * row))


def test_order_counts_lower_part() -> None:
    assert number(1.0) < DoubleDouble(1.0, 1e-20) <= DoubleDouble(1.0, 1e-20)
    assert DoubleDouble(1.0, 1e-20) > 1.0 >= DoubleDouble(1.0, -1e-20)
    nan = number(math.nan)
    assert not any((nan < 1.0, nan > 1.0, nan == 1.0, nan <= 1.0, nan >= 1.0))


def test_values_without_finite_result_equal_those_of_doubles() -> None:
    infinite = number(math.inf)
    assert infinite + 1.0 == infinite == infinite * 2.0 == number(1.0) / 0.0
    assert number(1.0) / infinite == 0.0
    for value in (infinite - infinite, number(0.0) / 0.0, FUNCTIONS["sqrt"](-1.0), FUNCTIONS["log"](-1.0)):
        assert value != value
    assert FUNCTIONS["exp"](-infinite) == 0.0
    assert FUNCTIONS["exp"](infinite) == infinite
    assert FUNCTIONS["log"](0.0) == -infinite


@pytest.mark.parametrize(
    ("x", "expected"), [(2.5, 2.0), (-2.5, -3.0), (DoubleDouble(3.0, -1e-20), 2.0), (DoubleDouble(3.0, 1e-20), 3.0)]
)
def test_floor_counts_lower_part(x, expected: float) -> None:
    assert FUNCTIONS["floor"](x) == expected
