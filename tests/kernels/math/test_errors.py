"""Errors of the elementary functions against mpmath, over random and adversarial arguments."""

import math
from collections.abc import Iterator

import pytest
from mpmath import mp, mpf

from lapwing.kernels import math as functions
from tests.kernels.math.accuracy import SAMPLERS, error, exact, measure, samples


@pytest.mark.parametrize("name", SAMPLERS)
def test_errors_over_random_arguments(name):
    errors = measure(name, samples(name, 500, seed=7))
    assert errors.worst < (0.6 if name == "hypot" else 0.51), errors  # subnormal lengths are rounded twice
    assert errors.misrounded < 3e-3, errors  # 1e-3 over the larger samples of the documentation


def _worst_angles() -> Iterator[float]:
    """Return for every binade up to the largest double the arguments nearest to multiples of pi/2.

    They are denominators of convergents of 2**e / (pi/2), times 2**e (Kahan; Muller, section 11.3.2).
    """
    with mp.workprec(2500):
        for exponent in range(-60, 971, 7):
            rest = mpf(2) ** exponent / (mp.pi / 2)
            before, now = 0, 1
            while now < 2**53:
                last = now
                rest = 1 / (rest - mp.floor(rest))
                before, now = now, int(mp.floor(rest)) * now + before
            if last > 2**45:
                yield math.ldexp(float(last), exponent)


WORST_ANGLES = (*_worst_angles(), math.ldexp(6381956970095103.0, 797))


def test_worst_angles_are_close_to_quarter_turns():
    assert min(abs(float(exact("sin", x))) for x in WORST_ANGLES) < 1e-17
    assert abs(float(exact("cos", WORST_ANGLES[-1]))) == pytest.approx(4.68717e-19, rel=1e-5)  # published by Kahan


@pytest.mark.parametrize("name", ["sin", "cos", "tan"])
def test_errors_near_quarter_turns(name):
    errors = measure(name, [(sign * x,) for x in WORST_ANGLES for sign in (1.0, -1.0)])
    assert errors.worst < 0.51, errors


@pytest.mark.parametrize("name", ["sin", "cos", "tan"])
@pytest.mark.parametrize("limit", [65536.0, math.pi / 128, math.pi / 4])
def test_errors_at_seams_of_reduction(name, limit):
    arguments = [math.nextafter(limit, math.inf), limit, math.nextafter(limit, 0.0)]
    arguments += [limit * (1.0 + k * 2.0**-50) for k in range(-40, 41)]
    assert measure(name, [(x,) for x in arguments]).worst < 0.51


@pytest.mark.parametrize(
    ("name", "seams"),
    [
        ("exp", [k * math.log(2) / 128 for k in range(-300, 301)]),
        ("expm1", [k * math.log(2) / 128 for k in range(-300, 301)] + [-40.0, 709.0, 709.7]),
        ("log", [0.6875 + k / 256 for k in range(177)]),
        ("log1p", [k / 256 - 0.3125 for k in range(177)]),
        ("atan", [(k + 0.5) / 64 for k in range(64)] + [1.0, 1e20]),
        ("asin", [k / 64 for k in range(1, 65)] + [math.sqrt(0.5)]),
        ("acos", [k / 64 for k in range(65)] + [math.sqrt(0.5)]),
        ("cbrt", [1.0, 2.0, 4.0, 8.0, 64.0, 2.0**-1022, 2.0**-1074]),
        ("tanh", [22.0, 0.01, 20.0, 1e-300]),
    ],
)
def test_errors_at_seams_of_tables(name, seams):
    around = [y for x in seams for y in (x, math.nextafter(x, math.inf), math.nextafter(x, -math.inf))]
    inside = [(y,) for y in around if name not in ("asin", "acos") or abs(y) <= 1.0]
    assert measure(name, inside).worst < 0.51


def _neighbours(value: float) -> list[float]:
    return [math.nextafter(value, -math.inf), value, math.nextafter(value, math.inf)]


@pytest.mark.parametrize("name", ["sin", "tan", "asin", "atan", "expm1", "log1p", "tanh", "cbrt", "sqrt"])
def test_errors_of_subnormal_arguments(name):
    arguments = [k * 5e-324 for k in (1, 2, 3, 5, 1000, 2**40 + 1, 2**51 + 1)] + _neighbours(2.0**-1022)
    assert measure(name, [(x,) for x in arguments]).worst <= 0.5


@pytest.mark.parametrize("k", [-1074, -1073, -1060, -1023, -1022, -1021])
def test_subnormal_results_of_exp_and_pow(k):
    for x in _neighbours(k * math.log(2)):
        assert error(functions.exp(x), exact("exp", x)) < 0.51
    assert functions.pow(2.0, float(k)) == math.ldexp(1.0, k)
    assert error(functions.pow(3.0, k * 0.63), exact("pow", 3.0, k * 0.63)) < 0.51


@pytest.mark.parametrize("e", [52, 53, 54, 55])
def test_halfway_cases_of_exp_and_cos(e):
    for x in (2.0**-e, -(2.0**-e), 3 * 2.0 ** -(e + 1)):
        assert error(functions.exp(x), exact("exp", x)) < 0.5001
    for x in (2.0 ** (-e / 2), 2.0**-26, 2.0**-26.5, 1.5 * 2.0**-26):
        assert error(functions.cos(x), exact("cos", x)) < 0.5001


def test_exact_results_are_exact():
    for n in range(1, 2000):
        assert functions.cbrt(float(n) ** 3) == n
        assert functions.hypot(3.0 * n, -4.0 * n) == 5.0 * n
        assert functions.pow(float(n), 3.0) == n**3
        assert functions.pow(float(n) ** 4, 0.25) == n
    for k in range(-1074, 1024):
        assert functions.pow(2.0, float(k)) == math.ldexp(1.0, k)
    for k in range(-1021, 1022):
        assert functions.hypot(3 * math.ldexp(1.0, k), 4 * math.ldexp(1.0, k)) == math.ldexp(5.0, k) or k > 1020
    assert functions.log(1.0) == 0.0
    assert functions.exp(1.0) == math.e
    assert functions.atan2(1.0, 1.0) * 4.0 == functions.acos(-1.0) == math.pi
