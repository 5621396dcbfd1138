"""The paper's method: its leading error is the curvature term of theory, eq. (6.12)."""

from typing import NamedTuple

import numpy as np
import pytest

from lapwing.dynamics.integrators import RATES, erk4m, integrate_fixed, rkmk54
from lapwing.dynamics.lie.quaternion import NO_ROTATION, Quaternion, log
from lapwing.dynamics.vector import Vec3, add, scale
from lapwing.kernels import always_inline


class RampParameters(NamedTuple):
    """omega_body = start + slope t: the simplest motion about a turning axis."""

    start: Vec3
    slope: Vec3


class RampState(NamedTuple):
    attitude: Quaternion


@always_inline
def ramp_rate(p, t, x):
    return RampState(add(p.start, scale(t, p.slope)))


RATES[RampParameters] = ramp_rate


def test_local_error_is_curvature_term():
    k, slope = np.array([0.7, -0.4, 0.5]), np.array([-0.3, 0.9, 0.6])
    p, x0, h = RampParameters(tuple(k), tuple(slope)), RampState(NO_ROTATION), 0.005
    actual = integrate_fixed(erk4m.Method(), p, 0.0, x0, h, 1)
    exact = integrate_fixed(rkmk54.Method(), p, 0.0, x0, h / 4, 4)
    error = np.array(log(actual.attitude)) - np.array(log(exact.attitude))
    predicted = h**4 / 192 * np.cross(k, np.cross(k, slope))
    assert error == pytest.approx(predicted, rel=0.02, abs=0.02 * abs(predicted).max())
