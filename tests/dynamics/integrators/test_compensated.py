"""Compensated sums of steps and plain sums against exact fractions, free fall and a 50-digit oscillator."""

from fractions import Fraction
from functools import cache
from typing import NamedTuple

import mpmath
import numpy as np
import pytest

from lapwing.dynamics.effects._types import Motion
from lapwing.dynamics.integrators import (
    RATES,
    CompensatedSum,
    CompensatedSummation,
    add,
    exact,
    get,
    integrate_fixed,
    names,
    rate,
    rounded,
    value_of,
)
from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.vehicles.multirotor_equations import with_tolerance
from lapwing.kernels import always_inline, kernel
from lapwing.kernels.state_tree import rounding_error
from lapwing.studies.accuracy.landings import cases

WITH_INCREMENT = [name for name in names() if hasattr(get(name), "increment")]
CHOICE = CompensatedSummation()


class FarFall(NamedTuple):
    acceleration: float


class Spring(NamedTuple):
    stiffness: float


@always_inline
def fall_rate(p, t, x):
    return (x[1], p.acceleration)


@always_inline
def spring_rate(p, t, x):
    return (x[1], -p.stiffness * x[0])


RATES[FarFall], RATES[Spring] = fall_rate, spring_rate


@cache
def compensated_steps(name: str):
    increment, method = get(name).increment, get(name).Method()

    @kernel
    def steps(p, x, h, n):
        x = exact(CHOICE, method, x)
        for _ in range(n):
            x = add(x, increment(rate, p, 0.0, x.value, h))
        return rounded(x)

    return steps


def ends(name: str, p, x: tuple, h: float, n: int) -> tuple[tuple, tuple]:
    """Return the states after n steps, as a plain and as a compensated sum."""
    return integrate_fixed(get(name).Method(), p, 0.0, x, h, n), compensated_steps(name)(p, x, h, n)


def units(value: float, true: Fraction) -> float:
    """Return an error in units in the last place."""
    return float(abs(Fraction(value) - true) / Fraction(float(np.spacing(abs(float(true))))))


def test_rounding_error_of_sum_is_exact():
    rng = np.random.default_rng(7)
    a, b = rng.normal(size=(2, 50)) * 10.0 ** rng.integers(-18, 19, (2, 50))
    x, v = tuple(a.tolist()), tuple(b.tolist())
    s = tuple(p + q for p, q in zip(x, v, strict=True))
    for *terms, total, error in zip(x, v, s, rounding_error(x, v, s), strict=True):
        assert sum(map(Fraction, terms)) == Fraction(total) + Fraction(error)


def test_remainder_is_kept_and_added():
    x = add(add(CompensatedSum((1.0,), (0.0,)), (2.0**-60,)), (2.0**-60,))
    assert (x.value, x.remainder) == ((1.0,), (2.0**-59,))
    assert value_of(add(x, (2.0**-53,))) == (1.0 + 2.0**-52,)


@pytest.mark.long
@pytest.mark.parametrize("name", ["rk4_renormalised", "rk8_renormalised"])
def test_fall_from_far_away_has_error_of_last_bit_after_any_steps(name):
    """Every method is exact for a parabola except for round-off, which includes that of rk8's weights."""
    h, start, speed, acceleration = 3.0 * 2.0**-15, 1000.1, 0.3, -0.7
    plain, compensated = [], []
    for n in (1000, 100_000):
        t = Fraction(h) * n
        true = (
            Fraction(start) + Fraction(speed) * t + Fraction(acceleration) * t * t / 2,
            Fraction(speed) + Fraction(acceleration) * t,
        )
        for x, errors in zip(
            ends(name, FarFall(acceleration), (start, speed), h, n), (plain, compensated), strict=True
        ):
            errors.append(max(map(units, x, true)))
    assert max(compensated) <= 4.0
    assert plain[1] > plain[0]
    assert plain[1] > 100.0


def test_oscillator_error_is_round_off_of_its_rate():
    """Runge-Kutta steps of a linear system are powers of a matrix; a sixth of h is a double."""
    h, n, p, start = 3.0 * 2.0**-13, 40_000, Spring(7.3), (0.7, -0.3)
    with mpmath.workdps(50):
        A = mpmath.matrix([[0, 1], [-mpmath.mpf(p.stiffness), 0]]) * mpmath.mpf(h)
        true = (mpmath.eye(2) + A + A**2 / 2 + A**3 / 6 + A**4 / 24) ** n * mpmath.matrix(start)
        plain, compensated = (
            max(float(abs(mpmath.mpf(a) - b)) for a, b in zip(x, true, strict=True))
            for x in ends("rk4", p, start, h, n)
        )
    assert compensated < 2.0 * 2.0**-53
    assert plain > 100.0 * 2.0**-53


def test_attitude_is_rounded_onto_manifold():
    x = CompensatedSum(Quaternion(1.0 + 1e-9, 0.0, 0.0, 0.0), (0.0,) * 4)
    assert rounded(x) == Quaternion(1.0, 0.0, 0.0, 0.0)


def test_sums_are_plain_without_choice_or_increment():
    x = (1.0, 2.0)
    assert "rkmk4" not in WITH_INCREMENT
    assert exact((), get("rk4").Method(), x) == x
    assert exact(CHOICE, get("rkmk4").Method(), x) == x
    assert exact(CHOICE, get("rk4").Method(), x) == CompensatedSum(x, (0.0, 0.0))


def test_accuracy_near_round_off_chooses_compensated_sums():
    p, state = cases.plant(cases.draw(0))
    assert isinstance(state.motion, Motion)
    assert [with_tolerance(p, tolerance).summation for tolerance in (1e-6, 1e-13, 5e-14)] == [(), (), CHOICE]
