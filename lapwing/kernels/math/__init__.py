"""Elementary functions with bit-for-bit identical results on every machine, in place of Python's `math`.

    from lapwing.kernels import math

Functions whose rounding depends on the C library are computed here (docs/explanation/elementary_functions.md).
Functions that IEEE 754 or integer arithmetic determines, and the constants, are those of Python's `math`. In compiled
code every function is a kernel. Called from Python, it executes the same operations as plain Python, with the same
result. Where Python's `math` raises a ValueError or OverflowError, the result is NaN or infinite.
"""

from math import (
    ceil,
    copysign,
    degrees,
    e,
    fabs,
    factorial,
    floor,
    fmod,
    frexp,
    inf,
    isfinite,
    isinf,
    isnan,
    isqrt,
    ldexp,
    nan,
    nextafter,
    pi,
    radians,
    remainder,
    sqrt,
    tau,
    trunc,
    ulp,
)  # fmt: skip

from lapwing.kernels.math import exponential, inverse_trigonometric, logarithm, roots, trigonometric
from lapwing.kernels.math._export import export
from lapwing.kernels.math.sums import dist, hypot, total

sin = export(trigonometric.sin, of_small=trigonometric.sin_of_small)
cos = export(trigonometric.cos, of_small=trigonometric.cos_of_small)
sincos = export(trigonometric.sincos, of_small=trigonometric.sincos_of_small)
tan = export(trigonometric.tan, of_small=trigonometric.tan_of_small)
asin = export(inverse_trigonometric.asin)
acos = export(inverse_trigonometric.acos)
atan = export(inverse_trigonometric.atan)
atan2 = export(inverse_trigonometric.atan2)
exp = export(exponential.exp, inline=True)
expm1 = export(exponential.expm1)
tanh = export(exponential.tanh)
log = export(logarithm.log, inline=True)
log1p = export(logarithm.log1p)
pow = export(logarithm.pow, inline=True)
cbrt = export(roots.cbrt)
square = export(roots.square, inline=True)

__all__ = [
    "acos", "asin", "atan", "atan2", "cbrt", "ceil", "copysign", "cos", "degrees", "dist", "e", "exp", "expm1", "fabs",
    "factorial", "floor", "fmod", "frexp", "hypot", "inf", "isfinite", "isinf", "isnan", "isqrt", "ldexp", "log",
    "log1p", "nan", "nextafter", "pi", "pow", "radians", "remainder", "sin", "sincos", "sqrt", "square", "tan", "tanh",
    "tau", "total", "trunc", "ulp",
]  # fmt: skip
