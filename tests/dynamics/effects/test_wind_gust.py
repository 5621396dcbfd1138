import pytest

from lapwing.dynamics.effects.wind_gust import WindGust, wind_gust

GUST = WindGust((4.0, 0.0, -2.0), 1.0, 2.0)


@pytest.mark.parametrize(("t", "part"), [(0.5, 0), (1.0, 0), (1.5, 0.5), (2.0, 1), (2.5, 0.5), (3.0, 0), (4.0, 0)])
def test_one_minus_cosine(situation, t, part):
    s = situation(t=t)
    wind = wind_gust.py_func(GUST, (), s, s.air).wind_world
    assert wind == pytest.approx((4.0 * part, 0.0, -2.0 * part), abs=1e-12)
