"""Checked runs: closed forms, error control, and errors on bad input."""

import math
from typing import NamedTuple

import numpy as np
import pytest

from lapwing.dynamics.integrators import RATES, get, simulate, solve
from lapwing.dynamics.lie.quaternion import NO_ROTATION, Quaternion
from lapwing.dynamics.vehicles.rigid_body import FreeBodyParameters, RigidBody
from lapwing.kernels import always_inline


class BlowUpParameters(NamedTuple):
    """x' = x^2 from 1 is 1 / (1 - t); NaN after the time `end`."""

    end: float


class NumberState(NamedTuple):
    level: float


@always_inline
def blow_up_rate(p, t, x):
    return NumberState(math.nan if t > p.end else x.level * x.level)


RATES[BlowUpParameters] = blow_up_rate

# spin about the symmetry axis with precession: all components are cosines
TOP = FreeBodyParameters((1.0, 1.0, 2.0))
START = RigidBody(NO_ROTATION, (0.3, 0.0, 1.0))


def precession(t):
    """Return omega_body of the symmetric free body, which rotates about z at (C - A) / A omega_z."""
    rate = (2.0 - 1.0) / 1.0 * 1.0
    return np.column_stack([0.3 * np.cos(rate * t), 0.3 * np.sin(rate * t), np.ones_like(t)])


@pytest.mark.parametrize("tolerance", [1e-4, 1e-7, 1e-10])
def test_adaptive_run_meets_its_tolerance_between_its_steps(tolerance):
    times = np.linspace(0.0, 10.0, 401)
    states, counts = solve(TOP, START, times, tolerance)
    assert abs(states[:, 4:] - precession(times)).max() < 20 * tolerance
    assert counts["steps"] < 401 or tolerance < 1e-8  # output times do not change the steps
    # the attitude too: the momentum is constant in the world
    w, x, y, z = states[:, :4].T
    momentum = states[:, 4:] * TOP.inertia
    world_z = 2 * (x * z - w * y) * momentum[:, 0] + 2 * (y * z + w * x) * momentum[:, 1]
    world_z += (1 - 2 * (x * x + y * y)) * momentum[:, 2]
    assert abs(world_z - 2.0).max() < 100 * tolerance


def test_step_count_follows_order_for_smaller_tolerance():
    counts = [solve(TOP, START, np.array([0.0, 20.0]), tol)[1]["steps"] for tol in (1e-6, 1e-11)]
    assert 6.0 < counts[1] / counts[0] < 16.0  # 1e5 ** (1/5) = 10


def test_simulate_writes_first_and_every_nth_state():
    times, states = simulate(get("rkmk4"), TOP, START, 0.01, 100, every=10)
    assert times == pytest.approx(np.linspace(0, 1, 11))
    assert states[0] == pytest.approx([1, 0, 0, 0, 0.3, 0, 1])
    assert abs(states[:, 4:] - precession(times)).max() < 1e-10


def test_pole_is_reported_with_time_and_state():
    with pytest.raises(
        ValueError, match=r"BlowUp: tolerance 1e-08 cannot be met at t = (0\.99999\d*|1) s, state level = "
    ):
        solve(BlowUpParameters(9.0), NumberState(1.0), np.array([0.0, 2.0]), 1e-8)


def test_nan_is_reported():
    with pytest.raises(ValueError, match=r"BlowUp: tolerance 1e-06 cannot be met at t = 0\.5"):
        solve(BlowUpParameters(0.5), NumberState(1.0), np.array([0.0, 1.0]), 1e-6)
    with pytest.raises(ValueError, match=r"BlowUp: not finite by t = 0\.6 s with step 0\.1: level = nan"):
        simulate(get("rk4"), BlowUpParameters(0.5), NumberState(1.0), 0.1, 10)
    with pytest.raises(ValueError, match=r"FreeBody: initial omega_body\[1\] = nan: must be finite"):
        simulate(get("rk4"), TOP, RigidBody(NO_ROTATION, (0.0, math.nan, 0.0)), 0.1, 10)
    with pytest.raises(ValueError, match=r"FreeBody: parameter inertia\[2\] = inf"):
        simulate(get("rk4"), FreeBodyParameters((1.0, 1.0, math.inf)), START, 0.1, 10)


@pytest.mark.parametrize("step", [0.0, -0.1, math.nan, math.inf])
def test_invalid_steps_are_rejected(step):
    with pytest.raises(ValueError, match=r"FreeBody: step .* must be positive and finite"):
        simulate(get("rk4"), TOP, START, step, 10)


def test_invalid_start_tolerance_and_times_are_rejected():
    with pytest.raises(ValueError, match=r"initial attitude is not a rotation, off its manifold by 1: norm"):
        simulate(get("rk4"), TOP, RigidBody(Quaternion(2.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), 0.1, 10)
    with pytest.raises(ValueError, match=r"FreeBody: initial attitude is not a rotation, all zero"):
        simulate(get("rk4"), TOP, RigidBody(Quaternion(0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), 0.1, 10)
    with pytest.raises(ValueError, match=r"tolerance 1e-20 cannot be met: at least 1e-14"):
        solve(TOP, START, np.array([0.0, 1.0]), 1e-20)
    with pytest.raises(ValueError, match="output times must be two or more and increase"):
        solve(TOP, START, np.array([0.0, 1.0, 1.0]), 1e-6)
