"""Sine, cosine and tangent.

The angle is reduced to the nearest of 128 directions (`reduction`); sine and cosine follow from those of the direction
by the addition theorems, with short polynomials for the remainder (Tang, "Table-lookup algorithms for elementary
functions and their error analysis", ARITH 10, 1991). The largest terms are exact products of 26 bits each, so that the
sum has about 65 correct bits before its one rounding.
"""

from lapwing.kernels.compiler.decorators import always_inline
from lapwing.kernels.math._primitives import quotient, split, table
from lapwing.kernels.math._tables import COSINE, SINE, SINES
from lapwing.kernels.math.reduction import reduce_argument, reduce_small_argument

_S3, _S5, _S7 = SINE
_C4, _C6, _C8 = COSINE
_sines = table("sines", SINES)  # for each direction: upper and lower part of the sine, of the cosine


@always_inline
def _parts(reduced):
    """Return sine and cosine of a reduced angle as two numbers each, to be added."""
    k, r, r_low = reduced
    at = 4 * k
    s1, s2, c1, c2 = _sines(at), _sines(at + 1), _sines(at + 2), _sines(at + 3)
    h1 = split(r)
    h2 = (r - h1) + r_low
    z = r * r
    sine = r * z * (_S3 + z * (_S5 + z * _S7))  # sin(r) - r
    cosine = z * (-0.5 + z * (_C4 + z * (_C6 + z * _C8))) - r * r_low  # cos(r) - 1
    s, c = s1 + s2, c1 + c2
    p = c1 * h1
    first_s = s1 + p
    rest_s = (p - (first_s - s1)) + ((s2 + (c * h2 + c2 * h1)) + (s * cosine + c * sine))
    q = s1 * h1
    first_c = c1 - q
    rest_c = ((c1 - first_c) - q) + ((c2 - (s * h2 + s2 * h1)) + (c * cosine - s * sine))
    return first_s, rest_s, first_c, rest_c


@always_inline
def _sin(x, reduced):
    s, s_low, _, _ = _parts(reduced)
    return s + s_low if x != 0.0 else x


@always_inline
def _cos(reduced):
    _, _, c, c_low = _parts(reduced)
    return c + c_low


@always_inline
def _sincos(x, reduced):
    s, s_low, c, c_low = _parts(reduced)
    return (s + s_low if x != 0.0 else x), c + c_low


@always_inline
def _tan(x, reduced):
    s, s_low, c, c_low = _parts(reduced)
    a = s + s_low
    b = c + c_low
    first, rest = quotient(a, s_low - (a - s), b, c_low - (b - c))
    return first + rest if x != 0.0 else x


@always_inline
def sin(x):
    """Return the sine of an angle [rad]."""
    return _sin(x, reduce_argument(x))


@always_inline
def cos(x):
    """Return the cosine of an angle [rad]."""
    return _cos(reduce_argument(x))


@always_inline
def sincos(x):
    """Return sine and cosine of an angle [rad], bit-for-bit those of `sin` and `cos`."""
    return _sincos(x, reduce_argument(x))


@always_inline
def tan(x):
    """Return the tangent of an angle [rad]."""
    return _tan(x, reduce_argument(x))


# The same for |x| <= LARGEST without a branch, so that loops over them are vectorised.


@always_inline
def sin_of_small(x):
    """Return the sine of an angle [rad]."""
    return _sin(x, reduce_small_argument(x))


@always_inline
def cos_of_small(x):
    """Return the cosine of an angle [rad]."""
    return _cos(reduce_small_argument(x))


@always_inline
def sincos_of_small(x):
    """Return sine and cosine of an angle [rad]."""
    return _sincos(x, reduce_small_argument(x))


@always_inline
def tan_of_small(x):
    """Return the tangent of an angle [rad]."""
    return _tan(x, reduce_small_argument(x))
