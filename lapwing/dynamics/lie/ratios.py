"""The even functions of an angle a [rad] in the exponential of a rotation and its derivatives, as functions of a^2.

Near zero, where the closed forms divide zero by zero or cancel, each is its Taylor series (theory, eq. (5.5)).
"""

from lapwing.kernels import always_inline, math

SINE = tuple((-1) ** k / math.factorial(2 * k + 1) for k in range(6))
COSINE = tuple((-1) ** k / math.factorial(2 * k + 2) for k in range(9))
CUBIC = tuple((-1) ** k / math.factorial(2 * k + 3) for k in range(9))
# |B_2k| / (2k)!, k = 1 ... 10, with the Bernoulli numbers B_2k
_BERNOULLI = (1 / 6, 1 / 30, 1 / 42, 1 / 30, 5 / 66, 691 / 2730, 7 / 6, 3617 / 510, 43867 / 798, 174611 / 330)
COTANGENT = tuple(b / math.factorial(2 * k + 2) for k, b in enumerate(_BERNOULLI))


@always_inline
def polynomial(coefficients, x):
    """Return coefficients[0] + coefficients[1] x + ..."""
    value = 0.0
    for i in range(len(coefficients) - 1, -1, -1):
        value = value * x + coefficients[i]
    return value


@always_inline
def sine_ratio(square):
    """Return sin(a) / a."""
    if square < 0.0625:
        return polynomial(SINE, square)
    a = math.sqrt(square)
    return math.sin(a) / a


@always_inline
def cosine_ratio(square):
    """Return (1 - cos(a)) / a^2, as 2 sin^2(a/2) / a^2, which does not cancel."""
    if square < 0.0625:
        return polynomial(COSINE, square)
    s = math.sin(0.5 * math.sqrt(square))
    return 2.0 * s * s / square


@always_inline
def cubic_ratio(square):
    """Return (a - sin(a)) / a^3."""
    if square < 1.0:
        return polynomial(CUBIC, square)
    a = math.sqrt(square)
    return (a - math.sin(a)) / (a * square)


@always_inline
def _two_product(a, b):
    """Return a b as an unevaluated sum of two floats (Dekker's splitting)."""
    p = a * b
    t = 134217729.0 * a
    a1 = t - (t - a)
    t = 134217729.0 * b
    b1 = t - (t - b)
    a2, b2 = a - a1, b - b1
    return p, ((a1 * b1 - p) + a1 * b2 + a2 * b1) + a2 * b2


@always_inline
def _two_sum(a, b):
    s = a + b
    t = s - a
    return s, (a - (s - t)) + (b - t)


@always_inline
def half_angle(v):
    """Return (a/2, sin(a/2), cos(a/2)) of a = |v|, both functions to full relative accuracy.

    Near 2 pi the sine is as small as the distance to the pole, and the rounding of |v| alone would cost it seven digits
    at 2 pi - 1e-6: the length is computed with twice the digits.
    """
    px, ex = _two_product(v[0], v[0])
    py, ey = _two_product(v[1], v[1])
    pz, ez = _two_product(v[2], v[2])
    s1, e1 = _two_sum(px, py)
    s2, e2 = _two_sum(s1, pz)
    a = math.sqrt(s2)
    pa, ea = _two_product(a, a)
    rest = 0.5 * ((s2 - pa) - ea + (e1 + e2 + ex + ey + ez)) / a  # |v| = a + rest
    half = 0.5 * a
    sine, cosine = math.sincos(half)
    return half, sine + 0.5 * rest * cosine, cosine - 0.5 * rest * sine


@always_inline
def cotangent_ratio(v):
    """Return (1 - (a/2) cot(a/2)) / a^2 of a = |v|, with its pole at 2 pi."""
    square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    if square < 1.0:
        return polynomial(COTANGENT, square)
    half, sine, cosine = half_angle(v)
    return (1.0 - half * cosine / sine) / square
