"""The fixed-point iteration ends when only rounding errors remain."""

from typing import NamedTuple

import pytest

from lapwing.dynamics.integrators import RATES, get, integrate_fixed
from lapwing.kernels import always_inline


class LagParameters(NamedTuple):
    target: float
    rate: float


class LagState(NamedTuple):
    speed: float
    distance: float


@always_inline
def lag_rate(p, t, x):
    return LagState(p.rate * (p.target - x.speed), 1e-3)


RATES[LagParameters] = lag_rate


@pytest.mark.parametrize("speed", [1.0, 330.0, 1e6])
def test_iteration_ends_when_large_numbers_cancel(speed):
    # a rotor close to its final speed: the difference of large numbers is only rounding
    p, h, n = LagParameters(speed, 20.3), 4e-3, 500
    end = integrate_fixed(get("implicit_lie_midpoint").Method(), p, 0.0, LagState(speed * 1.001, 0.0), h, n)
    factor = (1 - 0.5 * h * p.rate) / (1 + 0.5 * h * p.rate)
    assert end.speed == pytest.approx(speed + 1e-3 * speed * factor**n, rel=1e-14)
    assert end.distance == pytest.approx(2e-3, rel=1e-11)
