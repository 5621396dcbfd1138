"""Numbers with 32 digits: equal to the doubles of the kernels up to rounding, and their limits."""

import math
import random

import mpmath
import numpy as np
import pytest

from lapwing.kernels import math as kernel_math
from lapwing.studies.accuracy.extended_numbers import FUNCTIONS, Number

RANGES = {
    "acos": [(-1.0, 1.0)],
    "asin": [(-1.0, 1.0)],
    "atan": [(-9.0, 9.0)],
    "atan2": [(-9.0, 9.0), (-9.0, 9.0)],
    "cbrt": [(-90.0, 90.0)],
    "ceil": [(-9.0, 9.0)],
    "copysign": [(-9.0, 9.0), (-9.0, 9.0)],
    "cos": [(-50.0, 50.0)],
    "exp": [(-90.0, 90.0)],
    "expm1": [(-3.0, 3.0)],
    "floor": [(-9.0, 9.0)],
    "hypot": [(-9.0, 9.0), (-9.0, 9.0)],
    "isfinite": [(-9.0, 9.0)],
    "log": [(1e-9, 9.0)],
    "log1p": [(-0.9, 9.0)],
    "pow": [(0.01, 9.0), (-9.0, 9.0)],
    "sin": [(-50.0, 50.0)],
    "sincos": [(-50.0, 50.0)],
    "sqrt": [(0.0, 90.0)],
    "square": [(-9.0, 9.0)],
    "tan": [(-1.5, 1.5)],
    "tanh": [(-9.0, 9.0)],
}
INFINITY, NAN = Number(math.inf), Number(math.nan)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_function_equals_that_of_kernels(name: str) -> None:
    rng = random.Random(2)
    for _ in range(100):
        values = [rng.uniform(*limits) for limits in RANGES[name]]
        expected = np.atleast_1d(getattr(kernel_math, name)(*values))
        for arguments in (values, map(Number, values)):
            result = np.atleast_1d(FUNCTIONS[name](*arguments))
            np.testing.assert_allclose(result.astype(float), expected.astype(float), rtol=1e-15, atol=1e-16)


@pytest.mark.parametrize("name", [n for n in RANGES if n not in ("copysign", "isfinite", "pow", "sincos", "square")])
def test_function_has_digits(name: str) -> None:
    rng = random.Random(3)
    for _ in range(100):
        values = [Number(rng.uniform(*limits)) / 3 for limits in RANGES[name]]
        with mpmath.workdps(50):
            x = [mpmath.mpf(value) for value in values]
            exact = mpmath.sign(x[0]) * mpmath.cbrt(abs(x[0])) if name == "cbrt" else getattr(mpmath, name)(*x)
            result = mpmath.mpf(FUNCTIONS[name](*values))
            assert abs(result - exact) <= 1e-30 * abs(exact)


def test_third_has_32_digits() -> None:
    with mpmath.workdps(50):
        error = abs(mpmath.mpf(Number(1) / 3) - mpmath.mpf(1) / 3)
        assert 1e-40 < error < 1e-32


@pytest.mark.parametrize("left", [2.0, 2, np.float64(2.0)])
def test_operation_with_number_keeps_digits(left) -> None:
    third = Number(1) / 3
    for value in (left * third, left + third, left - third, left / third, third / left):
        assert isinstance(value, Number)
    assert left / third == 6


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (Number(1) / 0, INFINITY),
        (Number(-1) / 0.0, -INFINITY),
        (1.0 / Number(0), INFINITY),
        (Number(1) / INFINITY, 0),
        (Number(0) / 0, NAN),
        (INFINITY - INFINITY, NAN),
        (FUNCTIONS["sqrt"](Number(-1)), NAN),
        (FUNCTIONS["asin"](Number(2)), NAN),
        (FUNCTIONS["acos"](Number(-2)), NAN),
        (FUNCTIONS["log"](Number(-1)), NAN),
        (FUNCTIONS["log"](Number(0)), -INFINITY),
        (FUNCTIONS["log1p"](Number(-1)), -INFINITY),
        (FUNCTIONS["pow"](Number(0), -1.0), INFINITY),
        (FUNCTIONS["pow"](Number(0), 0.0), 1),
        (FUNCTIONS["exp"](-INFINITY), 0),
        (FUNCTIONS["exp"](INFINITY), INFINITY),
        (FUNCTIONS["sin"](INFINITY), NAN),
        (FUNCTIONS["cbrt"](Number(-8)), -2),
        (FUNCTIONS["copysign"](Number(3), -2.0), -3),
        (FUNCTIONS["copysign"](Number(-3), 0.0), 3),
    ],
)
def test_limit_equals_that_of_doubles(value, expected) -> None:
    assert value == expected or (value != value and expected != expected)


def test_division_of_other_users_of_mpmath_still_raises() -> None:
    with pytest.raises(ZeroDivisionError):
        mpmath.mpf(1) / 0


def test_digits_are_independent_of_other_users_of_mpmath() -> None:
    with mpmath.workdps(5):
        third = Number(1) / 3
    assert third == Number(1) / 3
