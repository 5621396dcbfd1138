"""Step doubling of a slow body at a jump of its force, against the closed form."""

import math
from typing import NamedTuple

import pytest

from lapwing.dynamics.integrators import RATES, StepDoubling, get, integrate_step_doubling
from lapwing.kernels import always_inline, kernel

JUMP = 1.0  # [m] position of the jump
DISTANCE, SPEED = 1e-6, 1e-5  # [m] before it and [m/s] at the start
SECONDS, TICK = 0.4, 4e-3


class JumpingForce(NamedTuple):
    before: float  # [m/s^2]
    beyond: float  # [m/s^2]


@always_inline
def jumping_force_rate(p, t, x):
    return (x[1], p.before if x[0] < JUMP else p.beyond)


RATES[JumpingForce] = jumping_force_rate


@kernel
def fly(how, p, x, ticks):
    for i in range(ticks):
        x = integrate_step_doubling(how, p, i * TICK, x, 1e-3, (i + 1) * TICK)
    return x


def closed_form(p):
    """Return position and speed after SECONDS of two constant accelerations."""
    speed = math.sqrt(SPEED**2 + 2.0 * p.before * DISTANCE)
    left = SECONDS - (speed - SPEED) / p.before
    return JUMP + speed * left + 0.5 * p.beyond * left**2, speed + p.beyond * left


@pytest.mark.parametrize("tolerance", [1e-13, 1e-14])
def test_slow_body_passes_jump_of_force(tolerance):
    """The shortest substeps move it by less than a unit in the last place of its position."""
    p = JumpingForce(1e-3, 1.0)
    how = StepDoubling(get("rk4").Method(), tolerance)
    x = fly(how, p, (JUMP - DISTANCE, SPEED), round(SECONDS / TICK))
    assert x == pytest.approx(closed_form(p), rel=0.0, abs=1e-12)
