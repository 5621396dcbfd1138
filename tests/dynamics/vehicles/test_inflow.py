"""Inflow against an independent solution of momentum theory and Leishman's fit."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from lapwing.dynamics.vehicles.inflow import axial, induced_velocity

PUBLISHED = (1.0, -1.125, -1.372, -1.718, -0.655)  # Leishman, section 2.13, with the ideal rotor's first coefficient


@pytest.mark.parametrize(("climb", "across"), [(0, 0), (0, 1), (0.5, 0.3), (2, 0), (0, 10), (-0.5, 2), (-3, 4), (5, 1)])
@pytest.mark.parametrize("kappa", [1.0, 1.15])
def test_glauert(climb, across, kappa):
    expected = brentq(lambda v: v * math.hypot(across, climb + v) - 1.0, 0.0, 5.0)
    assert induced_velocity(float(climb), float(across), kappa) == pytest.approx(kappa * expected, rel=1e-12)


@pytest.mark.parametrize(("kappa", "to_ring", "to_windmill"), [(1.0, 0.0053, 0.026), (1.15, 0.036, 0.176)])
def test_descent_is_near_published_fit(kappa, to_ring, to_windmill):
    """The published coefficients are rounded; the theory lists the largest differences."""
    fit = np.polynomial.Polynomial((kappa, *PUBLISHED[1:]))
    climb = np.linspace(-2.0 + 1e-12, -1e-12, 401)
    differences = np.abs([axial(x, kappa) for x in climb] - fit(climb))
    assert differences.max() == pytest.approx(to_windmill, rel=0.01)
    assert differences[climb >= -1.34].max() < to_ring


@pytest.mark.parametrize("climb", [-2.5, -4.0])
def test_windmill_brake_state(climb):
    v = axial(climb, 1.0)
    assert (climb + v) * v == pytest.approx(-1.0)
    assert v < 1.0


@pytest.mark.parametrize("kappa", [1.0, 1.15])
def test_inflow_is_continuous(kappa):
    assert axial(-2.0 - 1e-12, kappa) == pytest.approx(axial(-2.0 + 1e-12, kappa), abs=2e-6)  # a root on one side
    for across in (0.0, 0.3, 0.8):
        below, above = induced_velocity(-1e-9, across, kappa), induced_velocity(1e-9, across, kappa)
        assert below == pytest.approx(above, abs=1e-8)
    for climb in (-0.5, -1.5):
        inside, outside = induced_velocity(climb, 1.0 - 1e-9, kappa), induced_velocity(climb, 1.0 + 1e-9, kappa)
        assert inside == pytest.approx(outside, abs=1e-7)
