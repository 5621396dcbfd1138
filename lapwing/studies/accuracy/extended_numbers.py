"""Numbers with 32 decimal digits and the functions of `lapwing.kernels.math` for them, from mpmath.

Operations without a finite real result return infinity or NaN, as those of doubles do. There is no negative zero.
"""

import operator
from collections.abc import Callable
from typing import Any

import mpmath
from numba.extending import typeof_impl

from lapwing.kernels import simd

CONTEXT = mpmath.MPContext()  # of its own, because other users of mpmath set the digits of the common one
CONTEXT.dps = 32
Number: Any = CONTEXT.mpf

_divide = Number.__truediv__


def _quotient(x: Any, y: Any) -> Any:
    """Return x / y, by IEEE 754 also where y is 0."""
    return _divide(x, y) if y else x * CONTEXT.inf


Number.__truediv__ = _quotient
Number.__rtruediv__ = lambda x, y: _quotient(CONTEXT.mpf(y), x)


def _real(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that has NaN where the result of `function` is complex, and infinity at its poles."""

    def evaluate(*x: Any) -> Any:
        try:
            result = function(*x)
        except ZeroDivisionError:
            return CONTEXT.inf
        return CONTEXT.nan if isinstance(result, CONTEXT.mpc) else result

    return evaluate


def _sign(x: Any) -> Any:
    return CONTEXT.sign(x) or CONTEXT.one


def _sincos(x: Any) -> tuple[Any, Any]:
    cosine, sine = CONTEXT.cos_sin(x)
    return sine, cosine


FUNCTIONS: dict[str, Callable[..., Any]] = {
    "acos": _real(CONTEXT.acos),
    "asin": _real(CONTEXT.asin),
    "atan": CONTEXT.atan,
    "atan2": CONTEXT.atan2,
    "cbrt": lambda x: CONTEXT.sign(x) * CONTEXT.cbrt(abs(x)),
    "ceil": lambda x: int(CONTEXT.ceil(x)),
    "copysign": lambda x, y: abs(x) * _sign(y),
    "cos": CONTEXT.cos,
    "exp": CONTEXT.exp,
    "expm1": CONTEXT.expm1,
    "floor": lambda x: int(CONTEXT.floor(x)),
    "hypot": CONTEXT.hypot,
    "isfinite": CONTEXT.isfinite,
    "log": _real(CONTEXT.log),
    "log1p": _real(CONTEXT.log1p),
    "pow": _real(CONTEXT.power),
    "sin": CONTEXT.sin,
    "sincos": _sincos,
    "sqrt": _real(CONTEXT.sqrt),
    "square": lambda x: CONTEXT.mpf(x) * x,
    "tan": CONTEXT.tan,
    "tanh": CONTEXT.tanh,
}


class Lanes:
    """Four numbers in place of a vector of `lapwing.kernels.simd`."""

    def __init__(self, *numbers: Any):
        """Store one number for each lane."""
        self.numbers = numbers

    def __neg__(self) -> "Lanes":
        return Lanes(*(-number for number in self.numbers))


typeof_impl.register(Lanes)(lambda value, context: simd.LANES)


def _in_lanes(function: Callable[..., Any]) -> Callable[..., Lanes]:
    def evaluate(*x: Any) -> Lanes:
        return Lanes(*(function(*(a.numbers[k] if isinstance(a, Lanes) else a for a in x)) for k in range(4)))

    return evaluate


def _reflected(function: Callable[..., Any]) -> Callable[..., Any]:
    return lambda x, y: function(y, x)


for _operation in (operator.add, operator.sub, operator.mul, operator.truediv):
    setattr(Lanes, f"__{_operation.__name__}__", _in_lanes(_operation))
    setattr(Lanes, f"__r{_operation.__name__}__", _reflected(_in_lanes(_operation)))

VECTOR_FUNCTIONS: dict[Any, Callable[..., Any]] = {
    simd.any_above: lambda x: any(number > 0.0 for number in x.numbers),
    simd.pack4: Lanes,
    simd.select: _in_lanes(lambda flag, a, b: a if flag > 0.0 else b),
    simd.splat: lambda x: Lanes(x, x, x, x),
    simd.sqrt: _in_lanes(FUNCTIONS["sqrt"]),
    simd.unpack4: lambda x: x.numbers,
}
