import pytest

from lapwing.dynamics.effects.gravity_altitude import EARTH_RADIUS, GravityAltitude, gravity_altitude, weigh
from lapwing.dynamics.geodesy import Home


@pytest.mark.parametrize("height", [0.0, 1000.0, 10_000.0])
def test_weight_is_newtons_law(situation, rotors, height):
    e = GravityAltitude(9.80665, Home(height=500.0))
    s = situation(position=(0, 0, height))
    memory = weigh.py_func(e, e.initial_discrete_state(), s, rotors(), (0, 0), 0, 0.004)
    force, _ = gravity_altitude.py_func(e, memory, s, rotors())
    expected = 9.80665 * 10.0224 * (EARTH_RADIUS / (EARTH_RADIUS + 500.0 + height)) ** 2
    assert -force[2] == pytest.approx(expected, rel=1e-13)


def test_published_value_at_ten_kilometres():
    """U.S. Standard Atmosphere 1976, table I: 9.7759 m/s^2 at 10 km."""
    e = GravityAltitude(9.80665, Home(height=0.0))
    assert pytest.approx(9.7759, abs=1e-4) == 9.80665 * (EARTH_RADIUS / (EARTH_RADIUS + 10_000)) ** 2
    assert e.initial_discrete_state()[0] == 9.80665
