"""Error-free operations on doubles, access to their bits, and lookup of constants.

Everything here is exact, in compiled code and in plain Python alike. Sums: Knuth, "The Art of Computer Programming",
volume 2, section 4.2.2; Dekker, "A floating-point technique for extending the available precision", Numer. Math. 18
(1971), 224-242. Splitting: Veltkamp, as given there.
"""

# numba.core.types fills itself at import
# mypy: disable-error-code="attr-defined"

import struct
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import lower_builtin

from lapwing.kernels.compiler.decorators import always_inline

SPLITTER = 134217729.0  # 2**27 + 1
ROUNDER = 6755399441055744.0  # 1.5 * 2**52: added and subtracted, it rounds to an integer
SIGN = -0x8000000000000000
MAGNITUDE = 0x7FFFFFFFFFFFFFFF
MANTISSA = 0x000FFFFFFFFFFFFF

_DOUBLE, _INTEGER = ir.DoubleType(), ir.IntType(64)


def bits(x: float) -> int:
    """Return the 64 bits of a double as a signed integer."""
    return struct.unpack("<q", struct.pack("<d", x))[0]


def from_bits(i: int) -> float:
    """Return the double of 64 bits given as a signed integer."""
    return struct.unpack("<d", struct.pack("<q", i))[0]


def select(flag: bool, a: float, b: float) -> float:
    """Return a if flag, else b, without a branch: both are computed, and loops can be vectorised."""
    return a if flag else b


def _implement(function: Callable, returns: Any, arguments: tuple, lower: Callable[..., Any]) -> None:
    """Let a function be `lower(builder, *values)` in compiled code."""

    class Template(ConcreteTemplate):
        key = function
        cases = [signature(returns, *arguments)]  # noqa: RUF012

    infer_global(function, types.Function(Template))
    lower_builtin(function, *arguments)(lambda context, builder, sig, args: lower(builder, *args))


_implement(bits, types.int64, (types.float64,), lambda builder, x: builder.bitcast(x, _INTEGER))
_implement(from_bits, types.float64, (types.int64,), lambda builder, i: builder.bitcast(i, _DOUBLE))
_implement(
    select,
    types.float64,
    (types.boolean, types.float64, types.float64),
    lambda builder, flag, a, b: builder.select(flag, a, b),
)


def table(name: str, values: tuple) -> Callable[[int], Any]:
    """Return the function from an index to the value of a constant table; the index is not checked when compiled.

    Args:
        name: name of the constant in compiled code.
        values: doubles or integers, not mixed.
    """
    kind, number = (_DOUBLE, types.float64) if isinstance(values[0], float) else (_INTEGER, types.int64)
    content = ir.Constant(ir.ArrayType(kind, len(values)), list(values))

    def lower(builder: Any, index: Any) -> Any:
        symbol = f"lapwing.math.{name}"
        data = builder.module.globals.get(symbol)
        if data is None:
            data = cgutils.global_constant(builder.module, symbol, content)
            data.linkage, data.align = "private", 64
        return builder.load(builder.gep(data, [ir.IntType(32)(0), index], inbounds=True))

    def look_up(index: int) -> Any:
        return values[index]

    look_up.__name__ = look_up.__qualname__ = name
    _implement(look_up, number, (types.int64,), lower)
    return look_up


@always_inline
def split(a):
    """Return the upper 26 bits of a double of magnitude below 2**996, rounded to nearest."""
    c = SPLITTER * a
    return c - (c - a)


@always_inline
def two_sum(a, b):
    """Return a + b rounded, and the error (Knuth)."""
    s = a + b
    v = s - a
    return s, (a - (s - v)) + (b - v)


@always_inline
def quick_two_sum(a, b):
    """Return a + b rounded, and the error, if |a| >= |b| or a is 0 (Dekker)."""
    s = a + b
    return s, b - (s - a)


@always_inline
def exact_square(a):
    """Return a * a rounded, and the error."""
    p = a * a
    a1 = split(a)
    a2 = a - a1
    return p, ((a1 * a1 - p) + 2.0 * (a1 * a2)) + a2 * a2


@always_inline
def product(a, b):
    """Return a * b rounded, and the error."""
    p = a * b
    a1, b1 = split(a), split(b)
    a2, b2 = a - a1, b - b1
    return p, ((a1 * b1 - p) + (a1 * b2 + a2 * b1)) + a2 * b2


@always_inline
def quotient(n, n_low, d, d_low):
    """Return (n + n_low) / (d + d_low) as the sum of a number of 26 bits and a rest, to about 75 bits."""
    inverse = 1.0 / d
    first = split(n * inverse)
    d1 = split(d)
    rest = ((n - first * d1) - first * (d - d1)) + (n_low - first * d_low)
    return first, rest * inverse


@always_inline
def nearest(x):
    """Return x of magnitude below 2**51 rounded to an integer, ties to even."""
    return (x + ROUNDER) - ROUNDER


@always_inline
def with_sign(x, y):
    """Return the magnitude of x with the sign of y."""
    return from_bits((bits(x) & MAGNITUDE) | (bits(y) & SIGN))


@always_inline
def is_negative(x):
    """Return True if the sign bit of x is set."""
    return bits(x) < 0
