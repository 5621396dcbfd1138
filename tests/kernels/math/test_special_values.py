"""Limits, signed zeros, infinities and NaN, as ISO C (annex F) defines them."""

import math

import pytest

from lapwing.kernels import math as functions
from tests.kernels.math.kernels import KERNELS

INF, NAN = math.inf, math.nan
H, Q = math.pi / 2, math.pi / 4

ONE = {
    "sin": [(0.0, 0.0), (-0.0, -0.0), (INF, NAN), (-INF, NAN), (NAN, NAN)],
    "cos": [(0.0, 1.0), (-0.0, 1.0), (INF, NAN), (-INF, NAN), (NAN, NAN)],
    "tan": [(0.0, 0.0), (-0.0, -0.0), (INF, NAN), (-INF, NAN), (NAN, NAN)],
    "asin": [(0.0, 0.0), (-0.0, -0.0), (1.0, H), (-1.0, -H), (1.0000000000000002, NAN), (-INF, NAN), (NAN, NAN)],
    "acos": [(0.0, H), (1.0, 0.0), (-1.0, math.pi), (-1.0000000000000002, NAN), (INF, NAN), (NAN, NAN)],
    "atan": [(0.0, 0.0), (-0.0, -0.0), (INF, H), (-INF, -H), (1.0, Q), (NAN, NAN), (1e300, H)],
    "exp": [(0.0, 1.0), (-0.0, 1.0), (INF, INF), (-INF, 0.0), (NAN, NAN), (709.783, INF), (-745.14, 0.0),
            (-745.0, 5e-324), (1e300, INF), (-1e300, 0.0)],
    "expm1": [(0.0, 0.0), (-0.0, -0.0), (INF, INF), (-INF, -1.0), (NAN, NAN), (709.783, INF), (-1e300, -1.0)],
    "log": [(0.0, -INF), (-0.0, -INF), (1.0, 0.0), (INF, INF), (-1.0, NAN), (-INF, NAN), (NAN, NAN)],
    "log1p": [(0.0, 0.0), (-0.0, -0.0), (-1.0, -INF), (INF, INF), (-2.0, NAN), (-INF, NAN), (NAN, NAN)],
    "cbrt": [(0.0, 0.0), (-0.0, -0.0), (-8.0, -2.0), (INF, INF), (-INF, -INF), (NAN, NAN)],
    "tanh": [(0.0, 0.0), (-0.0, -0.0), (INF, 1.0), (-INF, -1.0), (NAN, NAN), (1e300, 1.0), (-5e-324, -5e-324)],
}  # fmt: skip
TWO = {
    "atan2": [
        (0.0, 0.0, 0.0), (-0.0, 0.0, -0.0), (0.0, -0.0, math.pi), (-0.0, -0.0, -math.pi), (0.0, 1.0, 0.0),
        (-0.0, 1.0, -0.0), (0.0, -1.0, math.pi), (-0.0, -1.0, -math.pi), (1.0, 0.0, H), (-1.0, -0.0, -H),
        (INF, INF, Q), (-INF, INF, -Q), (INF, -INF, 3 * Q), (-INF, -INF, -3 * Q), (1.0, INF, 0.0), (-1.0, INF, -0.0),
        (1.0, -INF, math.pi), (-1.0, -INF, -math.pi), (INF, 1.0, H), (-INF, -1.0, -H), (NAN, 1.0, NAN), (1.0, NAN, NAN),
        (5e-324, 1e308, 0.0), (-5e-324, 1e308, -0.0), (5e-324, -1e308, math.pi), (1e308, 5e-324, H),
    ],
    "hypot": [
        (0.0, 0.0, 0.0), (-0.0, -0.0, 0.0), (INF, NAN, INF), (NAN, -INF, INF), (NAN, 1.0, NAN), (0.0, NAN, NAN),
        (3e307, 4e307, 5e307), (5e-324, 0.0, 5e-324), (1.7e308, 1.7e308, INF), (-2.0, 0.0, 2.0),
    ],
    "pow": [
        (NAN, 0.0, 1.0), (0.0, -0.0, 1.0), (1.0, NAN, 1.0), (1.0, INF, 1.0), (-1.0, INF, 1.0), (-1.0, -INF, 1.0),
        (NAN, 1.0, NAN), (2.0, NAN, NAN), (0.0, 3.0, 0.0), (-0.0, 3.0, -0.0), (-0.0, 2.0, 0.0), (0.0, -3.0, INF),
        (-0.0, -3.0, -INF), (-0.0, -2.0, INF), (-0.0, -0.5, INF), (0.5, INF, 0.0), (0.5, -INF, INF), (2.0, INF, INF),
        (2.0, -INF, 0.0), (INF, 2.0, INF), (INF, -2.0, 0.0), (-INF, 3.0, -INF), (-INF, 2.0, INF), (-INF, -3.0, -0.0),
        (-INF, -2.0, 0.0), (-INF, 0.5, INF), (-8.0, 1.0 / 3.0, NAN), (-2.0, 3.0, -8.0), (-2.0, 2.0, 4.0),
        (-2.0, -1.0, -0.5), (2.0, 1024.0, INF), (2.0, -1080.0, 0.0), (-2.0, 1025.0, -INF), (-2.0, -1081.0, -0.0),
        (0.9999999999999999, 1e300, 0.0), (1.0000000000000002, 1e300, INF), (-3.0, 1e300, INF), (7.0, 1.0, 7.0),
        (-1.0, 9007199254740991.0, -1.0), (-1.0, 9007199254740992.0, 1.0), (-1.0, 4503599627370497.0, -1.0),
        (-1.0, 4503599627370495.5, NAN), (5e-324, 1.0, 5e-324), (5e-324, 2.0, 0.0),
    ],
}  # fmt: skip
CASES = [(name, *case) for table in (ONE, TWO) for name, cases in table.items() for case in cases]


def _same(a: float, b: float) -> bool:
    return (a != a and b != b) or (a == b and math.copysign(1.0, a) == math.copysign(1.0, b))


@pytest.mark.parametrize("case", CASES, ids=str)
def test_special_value(case):
    name, *arguments, expected = case
    assert _same(getattr(functions, name)(*arguments), expected)
    assert _same(KERNELS[name](*arguments), expected)
