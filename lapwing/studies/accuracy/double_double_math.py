"""Elementary functions of double-double numbers.

Source: Hida, Li, Bailey, "Algorithms for quad-double precision floating point arithmetic", ARITH 15 (2001): Taylor
series of a reduced argument, and one Newton step from the double for roots and inverse functions.
"""

import math
from collections.abc import Callable
from typing import Any

from lapwing.studies.accuracy.double_double import DoubleDouble, number

HALVINGS = 8  # of the argument of the exponential's series
LN2 = DoubleDouble(math.log(2.0), 2.3190468138462996e-17)
_QUARTER = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591833e-33)  # pi / 2 in three parts
_INVERSE_FACTORIALS = [number(1)]
for _n in range(1, 31):
    _INVERSE_FACTORIALS.append(_INVERSE_FACTORIALS[-1] / _n)


def _series(coefficients: list[DoubleDouble], x: DoubleDouble) -> DoubleDouble:
    result = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        result = result * x + coefficient
    return result


def square(x: Any) -> DoubleDouble:
    """Return x squared."""
    return number(x) * x


def is_finite(x: Any) -> bool:
    """Return True if x is neither infinite nor NaN."""
    return math.isfinite(number(x).high)


def copysign(x: Any, y: Any) -> DoubleDouble:
    """Return the magnitude of x with the sign of y."""
    return abs(number(x)) if math.copysign(1.0, number(y).high) > 0.0 else -abs(number(x))


def floor(x: Any) -> DoubleDouble:
    """Return the largest integer that is not above x."""
    x = number(x)
    if not math.isfinite(x.high):
        return x
    whole = float(math.floor(x.high))
    return DoubleDouble(whole, float(math.floor(x.low))) if whole == x.high else DoubleDouble(whole)


def sqrt(x: Any) -> DoubleDouble:
    """Return the square root; NaN of a negative number."""
    x = number(x)
    if not 0.0 < x.high < math.inf:
        return DoubleDouble(x.high if x.high >= 0.0 else math.nan)
    root = math.sqrt(x.high)
    return DoubleDouble(root, (x - number(root) * root).high / (2.0 * root))


def cbrt(x: Any) -> DoubleDouble:
    """Return the cube root."""
    x = number(x)
    root = number(math.copysign(abs(x.high) ** (1.0 / 3.0), x.high))
    if not root or not is_finite(root):
        return root
    return root - (root * root * root - x) / (3.0 * square(root))


def hypot(x: Any, y: Any) -> DoubleDouble:
    """Return the length of the vector (x, y)."""
    return sqrt(square(x) + square(y))


def _exponential(x: DoubleDouble) -> tuple[DoubleDouble, float]:
    """Return e and f with exp(x) = (e + 1) f, f a power of two."""
    if not abs(x.high) < 700.0:
        return DoubleDouble(math.nan if x.high != x.high else 0.0), math.inf if x.high > 0.0 else 0.0
    k = round(x.high / LN2.high)
    r = (x - LN2 * k) * 2.0**-HALVINGS
    result = r * _series(_INVERSE_FACTORIALS[1:13], r)
    for _ in range(HALVINGS):
        result = 2.0 * result + square(result)
    return result, 2.0**k


def exp(x: Any) -> DoubleDouble:
    """Return e to the power of x, 0 below -700 and infinity above 700."""
    rest, factor = _exponential(number(x))
    return (rest + 1.0) * factor


def expm1(x: Any) -> DoubleDouble:
    """Return exp(x) - 1, accurate near 0."""
    rest, factor = _exponential(number(x))
    return rest if factor == 1.0 else (rest + 1.0) * factor - 1.0


def log1p(x: Any) -> DoubleDouble:
    """Return the logarithm of 1 + x, accurate near 0; NaN below -1."""
    x = number(x)
    if not -1.0 < x.high < math.inf:
        return DoubleDouble(-math.inf if x.high == -1.0 else x.high if x.high > 0.0 else math.nan)
    guess = number(math.log1p(x.high))
    power = expm1(guess)
    return guess + (x - power) / (1.0 + power)


def log(x: Any) -> DoubleDouble:
    """Return the natural logarithm; NaN of a negative number."""
    x = number(x)
    if 0.5 < x.high < 2.0 or not 0.0 < x.high < math.inf:
        return log1p(x - 1.0)
    guess = number(math.log(x.high))
    return guess + (x * exp(-guess) - 1.0)


def power(x: Any, y: Any) -> DoubleDouble:
    """Return x to the power of y, x at least 0."""
    x, y = number(x), number(y)
    if not x:
        return DoubleDouble(1.0 if not y else 0.0 if y > 0.0 else math.inf)
    return exp(y * log(x))


def tanh(x: Any) -> DoubleDouble:
    """Return the hyperbolic tangent."""
    x = number(x)
    if abs(x.high) > 40.0:
        return DoubleDouble(math.copysign(1.0, x.high))
    rest = expm1(2.0 * x)
    return rest / (rest + 2.0)


def sincos(x: Any) -> tuple[DoubleDouble, DoubleDouble]:
    """Return sine and cosine of an angle [rad] of magnitude up to about 1e9; NaN of an infinite one."""
    x = number(x)
    if not math.isfinite(x.high):
        return DoubleDouble(math.nan), DoubleDouble(math.nan)
    k = round(x.high / _QUARTER[0])
    for part in _QUARTER:
        x = x - number(part) * k
    z = -square(x)
    sine, cosine = x * _series(_INVERSE_FACTORIALS[1:30:2], z), _series(_INVERSE_FACTORIALS[0:30:2], z)
    for _ in range(k % 4):
        sine, cosine = cosine, -sine
    return sine, cosine


def sin(x: Any) -> DoubleDouble:
    """Return the sine of an angle [rad]."""
    return sincos(x)[0]


def cos(x: Any) -> DoubleDouble:
    """Return the cosine of an angle [rad]."""
    return sincos(x)[1]


def tan(x: Any) -> DoubleDouble:
    """Return the tangent of an angle [rad]."""
    sine, cosine = sincos(x)
    return sine / cosine


def atan2(y: Any, x: Any) -> DoubleDouble:
    """Return the angle [rad] of the vector (x, y)."""
    y, x = number(y), number(x)
    guess = number(math.atan2(y.high, x.high))
    length = hypot(x, y)
    if not length or not is_finite(length):
        return guess
    sine, cosine = sincos(guess)
    return guess + (y * cosine - x * sine) / length


def atan(x: Any) -> DoubleDouble:
    """Return the arc tangent [rad]."""
    return atan2(x, 1.0)


def asin(x: Any) -> DoubleDouble:
    """Return the arc sine [rad]; NaN outside [-1, 1]."""
    return atan2(x, sqrt((1.0 - number(x)) * (1.0 + number(x))))


def acos(x: Any) -> DoubleDouble:
    """Return the arc cosine [rad]; NaN outside [-1, 1]."""
    return atan2(sqrt((1.0 - number(x)) * (1.0 + number(x))), x)


FUNCTIONS: dict[str, Callable[..., Any]] = {
    function.__name__: function
    for function in (
        acos, asin, atan, atan2, cbrt, copysign, cos, exp, expm1, floor, hypot, log, log1p, sin, sincos, sqrt, square,
        tan, tanh,
    )
} | {"pow": power, "isfinite": is_finite}  # fmt: skip
