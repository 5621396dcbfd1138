"""Against momentum theory solved by another method, and Leishman's fit."""

import math

import pytest
from scipy.optimize import brentq

from lapwing.dynamics.vehicles.inflow import axial, induced_velocity


@pytest.mark.parametrize(("climb", "across"), [(0, 0), (0, 1), (0.5, 0.3), (2, 0), (0, 10), (-0.5, 2), (-3, 4), (5, 1)])
def test_glauert(climb, across):
    expected = brentq(lambda v: v * math.hypot(across, climb + v) - 1.0, 0.0, 5.0)
    assert induced_velocity(float(climb), float(across)) == pytest.approx(expected, rel=1e-12)


def test_descent_by_the_published_fit_and_the_windmill_brake_state():
    """v/v_h = 1 - 1.125 x - 1.372 x^2 - 1.718 x^3 - 0.655 x^4 by hand; below -2 from (V + v) v = -1."""
    assert induced_velocity(-1.0, 0.0) == pytest.approx(1.0 + 1.125 - 1.372 + 1.718 - 0.655)
    assert induced_velocity(-1.5, 0.0) == pytest.approx(1 + 1.6875 - 3.087 + 5.79825 - 3.3159375)
    for climb in (-2.5, -4.0):
        v = axial(climb)
        assert (climb + v) * v == pytest.approx(-1.0)
        assert v < 1.0
    assert axial(-2.001) == pytest.approx(axial(-1.999), abs=0.07)


def test_it_is_continuous_at_hover_and_where_the_ring_is_blown_away():
    for across in (0.0, 0.3, 0.8):
        assert induced_velocity(-1e-9, across) == pytest.approx(induced_velocity(1e-9, across), abs=1e-8)
    for climb in (-0.5, -1.5):
        assert induced_velocity(climb, 1.0 - 1e-9) == pytest.approx(induced_velocity(climb, 1.0 + 1e-9), abs=1e-7)
