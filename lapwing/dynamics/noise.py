"""Stateless random numbers: a draw is a pure function of (key, tick, lane).

Philox 4x32-10 of Salmon, Moraes, Dror and Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC'11. Normal draws
invert the distribution function by Wichura's algorithm AS 241 (PPND16, Applied Statistics 37(3) 1988, 477-484).
Only +, -, *, / and square roots are used, whose rounding IEEE 754 determines: bit-for-bit identical results on every
machine and in every mode of a run, with any mathematics library (theory, section 3.1).
"""

import hashlib

import numpy as np

from lapwing.kernels import always_inline, kernel, math

Key = tuple[int, int]  # two words of 32 bits

TURN_ON = -1  # tick of draws before the first tick of a run

_MULTIPLIER_0, _MULTIPLIER_1 = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
_WEYL_0, _WEYL_1 = np.uint64(0x9E3779B9), np.uint64(0xBB67AE85)
_MASK, _SHIFT = np.uint64(0xFFFFFFFF), np.uint64(32)
_TWO_TO_MINUS_32 = 2.0**-32
_LN_2 = math.log(2.0)


def stream_key(seed: int, vehicle: str, stream: str) -> Key:
    """Return the key of a stream of random numbers: the first 64 bits of BLAKE2b over the three names.

    Args:
        seed: any integer, from the scene.
        vehicle: name of the vehicle, or "" for streams shared by all vehicles.
        stream: name of the stream, e.g. "imu" or "wind".
    """
    # The separator cannot be part of a name: ("a", "bc") and ("ab", "c") differ.
    text = "\0".join((str(int(seed)), vehicle, stream))
    digest = hashlib.blake2b(text.encode(), digest_size=8).digest()
    return int.from_bytes(digest[:4], "little"), int.from_bytes(digest[4:], "little")


@always_inline
def philox(c0, c1, c2, c3, k0, k1):
    """Return four random words of 32 bits by Philox 4x32-10, from a counter of four and a key of two, all uint64."""
    for _ in range(10):
        p0 = _MULTIPLIER_0 * c0
        p1 = _MULTIPLIER_1 * c2
        c0, c1, c2, c3 = (p1 >> _SHIFT) ^ c1 ^ k0, p1 & _MASK, (p0 >> _SHIFT) ^ c3 ^ k1, p0 & _MASK
        k0 = (k0 + _WEYL_0) & _MASK
        k1 = (k1 + _WEYL_1) & _MASK
    return c0, c1, c2, c3


@always_inline
def words(key, tick, lane):
    """Return the four random words of 32 bits at (tick, lane), as uint64."""
    t = np.uint64(tick)
    return philox(t & _MASK, t >> _SHIFT, np.uint64(lane), np.uint64(0), np.uint64(key[0]), np.uint64(key[1]))


@always_inline
def _unit(word):
    """Return the centre of the word's cell in (0, 1): symmetric about 1/2, never 0 or 1."""
    return (np.float64(word) + 0.5) * _TWO_TO_MINUS_32


@kernel
def uniform4(key, tick, lane):
    """Return four independent draws from the uniform distribution on (0, 1)."""
    w = words(key, tick, lane)
    return _unit(w[0]), _unit(w[1]), _unit(w[2]), _unit(w[3])


@kernel
def uniform(key, tick, lane):
    """Return one draw from the uniform distribution on (0, 1)."""
    return _unit(words(key, tick, lane)[0])


@always_inline
def _log(x):
    """Return the logarithm of a positive normal number: exponent and mantissa, then 2 artanh((m - 1)/(m + 1))."""
    m, e = math.frexp(x)  # m in [1/2, 1)
    if m < 0.7071067811865476:
        m *= 2.0
        e -= 1
    s = (m - 1.0) / (m + 1.0)  # |s| <= 0.172: the term s^23 is below one rounding
    z = s * s
    series = 1.0 / 19.0 + z / 21.0
    for odd in (17.0, 15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0, 1.0):
        series = 1.0 / odd + z * series
    return e * _LN_2 + 2.0 * s * series


@always_inline
def _polynomial(x, c):
    value = c[7]
    for i in (6, 5, 4, 3, 2, 1, 0):
        value = value * x + c[i]
    return value


# Wichura's coefficients of the three ranges: numerator and denominator, constant term first.
_CENTRE = (
    (3.3871328727963666080e0, 1.3314166789178437745e2, 1.9715909503065514427e3, 1.3731693765509461125e4,
     4.5921953931549871457e4, 6.7265770927008700853e4, 3.3430575583588128105e4, 2.5090809287301226727e3),
    (1.0, 4.2313330701600911252e1, 6.8718700749205790830e2, 5.3941960214247511077e3,
     2.1213794301586595867e4, 3.9307895800092710610e4, 2.8729085735721942674e4, 5.2264952788528545610e3),
)  # fmt: skip
_MIDDLE = (
    (1.42343711074968357734e0, 4.63033784615654529590e0, 5.76949722146069140550e0, 3.64784832476320460504e0,
     1.27045825245236838258e0, 2.41780725177450611770e-1, 2.27238449892691845833e-2, 7.74545014278341407640e-4),
    (1.0, 2.05319162663775882187e0, 1.67638483018380384940e0, 6.89767334985100004550e-1,
     1.48103976427480074590e-1, 1.51986665636164571966e-2, 5.47593808499534494600e-4, 1.05075007164441684324e-9),
)  # fmt: skip
_TAIL = (
    (6.65790464350110377720e0, 5.46378491116411436990e0, 1.78482653991729133580e0, 2.96560571828504891230e-1,
     2.65321895265761230930e-2, 1.24266094738807843860e-3, 2.71155556874348757815e-5, 2.01033439929228813265e-7),
    (1.0, 5.99832206555887937690e-1, 1.36929880922735805310e-1, 1.48753612908506148525e-2,
     7.86869131145613259100e-4, 1.84631831751005468180e-5, 1.42151175831644588870e-7, 2.04426310338993978564e-15),
)  # fmt: skip


@kernel
def normal_quantile(p):
    """Return the inverse of the standard normal distribution function for p in (0, 1) (AS 241)."""
    q = p - 0.5
    if abs(q) <= 0.425:
        r = 0.180625 - q * q
        return q * _polynomial(r, _CENTRE[0]) / _polynomial(r, _CENTRE[1])
    r = math.sqrt(-_log(min(p, 1.0 - p)))
    if r <= 5.0:
        r -= 1.6
        x = _polynomial(r, _MIDDLE[0]) / _polynomial(r, _MIDDLE[1])
    else:
        r -= 5.0
        x = _polynomial(r, _TAIL[0]) / _polynomial(r, _TAIL[1])
    return -x if q < 0.0 else x


@kernel
def normal(key, tick, lane):
    """Return one draw from the standard normal distribution."""
    return normal_quantile(_unit(words(key, tick, lane)[0]))


@kernel
def normal3(key, tick, lane):
    """Return three independent draws from the standard normal distribution, as a vector."""
    w = words(key, tick, lane)
    return normal_quantile(_unit(w[0])), normal_quantile(_unit(w[1])), normal_quantile(_unit(w[2]))
