import math

import pytest

from lapwing.dynamics.effects.wind_gust import WindGust, edges, wind_gust

GUST = WindGust((4.0, 0.0, -2.0), 1.0, 2.0)


@pytest.mark.parametrize(("t", "part"), [(0.5, 0), (1.0, 0), (1.5, 0.5), (2.0, 1), (2.5, 0.5), (3.0, 0), (4.0, 0)])
def test_one_minus_cosine(situation, t, part):
    s = situation(t=t)
    wind = wind_gust.py_func(GUST, (), s, s.air).wind_world
    assert wind == pytest.approx((4.0 * part, 0.0, -2.0 * part), abs=1e-12)


@pytest.mark.parametrize(
    ("t", "h", "following"),
    [
        (0.0, 0.001, 1.0),
        (1.0, 0.001, 3.0),
        (3.0, 0.001, math.inf),
        (1.0, 0.2, 1.125),
        (1.2, 0.2, 1.25),
        (3.0, 0.2, math.inf),
    ],
)
def test_break_times_are_edges_and_parts_of_short_gust(t, h, following):
    assert edges.py_func(GUST, (), t, h, math.inf) == pytest.approx(following)
    assert edges.py_func(GUST, (), t, h, 0.5) == 0.5
