"""Double-double numbers: unevaluated sums of two doubles, with about 32 decimal digits.

Source: Dekker, "A floating-point technique for extending the available precision", Numer. Math. 18 (1971), 224-242.
"""

import math
from typing import Any

SPLITTER = 134217729.0  # 2**27 + 1


def _two_sum(a: float, b: float) -> tuple[float, float]:
    s = a + b
    v = s - a
    return s, (a - (s - v)) + (b - v)


def _product(a: float, b: float) -> tuple[float, float]:
    p = a * b
    c, d = SPLITTER * a, SPLITTER * b
    a1, b1 = c - (c - a), d - (d - b)
    a2, b2 = a - a1, b - b1
    return p, ((a1 * b1 - p) + (a1 * b2 + a2 * b1)) + a2 * b2


def _quotient(a: float, b: float) -> float:
    """Return a / b, by IEEE 754 also where b is 0."""
    if b:
        return a / b
    return math.nan if a == 0.0 or a != a else math.copysign(math.inf, a) * math.copysign(1.0, b)


class DoubleDouble:
    """A number `high + low` with |low| at most half a unit in the last place of high."""

    __slots__ = ("high", "low")
    __array_ufunc__ = None  # a numpy scalar on the left leaves the operation to this class

    def __init__(self, high: float, low: float = 0.0):
        s = float(high) + low
        self.high = s
        self.low = low - (s - high) if math.isfinite(s) else 0.0

    def __repr__(self) -> str:
        return f"DoubleDouble({self.high!r}, {self.low!r})"

    def __float__(self) -> float:
        return self.high

    def __int__(self) -> int:
        return int(self.high) + int(self.low)

    def __hash__(self) -> int:
        return hash((self.high, self.low))

    def __bool__(self) -> bool:
        return self.high != 0.0

    def __eq__(self, other: object) -> bool:
        b = number(other)
        return self.high == b.high and self.low == b.low

    def __lt__(self, other: Any) -> bool:
        b = number(other)
        return self.high < b.high or (self.high == b.high and self.low < b.low)

    def __le__(self, other: Any) -> bool:
        return self < other or self == other

    def __gt__(self, other: Any) -> bool:
        return number(other) < self

    def __ge__(self, other: Any) -> bool:
        return self > other or self == other

    def __neg__(self) -> "DoubleDouble":
        return DoubleDouble(-self.high, -self.low)

    def __pos__(self) -> "DoubleDouble":
        return self

    def __abs__(self) -> "DoubleDouble":
        return -self if math.copysign(1.0, self.high) < 0.0 else self

    def __add__(self, other: Any) -> "DoubleDouble":
        b = number(other)
        s, e = _two_sum(self.high, b.high)
        if not math.isfinite(s):
            return DoubleDouble(s)
        t, f = _two_sum(self.low, b.low)
        e += t
        upper = s + e
        return DoubleDouble(upper, (e - (upper - s)) + f)

    __radd__ = __add__

    def __sub__(self, other: Any) -> "DoubleDouble":
        return self + -number(other)

    def __rsub__(self, other: Any) -> "DoubleDouble":
        return number(other) + -self

    def __mul__(self, other: Any) -> "DoubleDouble":
        b = number(other)
        p, e = _product(self.high, b.high)
        if not math.isfinite(e):
            return DoubleDouble(p)
        return DoubleDouble(p, e + (self.high * b.low + self.low * b.high))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> "DoubleDouble":
        b = number(other)
        first = _quotient(self.high, b.high)
        if not math.isfinite(first) or not math.isfinite(b.high):
            return DoubleDouble(first)
        rest = self - b * first
        second = rest.high / b.high
        return DoubleDouble(first, second) + (rest - b * second).high / b.high

    def __rtruediv__(self, other: Any) -> "DoubleDouble":
        return number(other) / self


def number(x: Any) -> DoubleDouble:
    """Return a number as a double-double."""
    return x if type(x) is DoubleDouble else DoubleDouble(float(x))
