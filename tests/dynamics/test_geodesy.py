"""Geodesy against pymap3d, an independent implementation, and published gravity."""

import numpy as np
import pymap3d
import pytest

from lapwing.dynamics import geodesy
from lapwing.dynamics.geodesy import Home

HOMES = [Home(40.7686, 14.7907, 280.0), Home(-33.9, 151.2, 30.0), Home(0.0, 180.0, -20.0), Home(78.2, -15.6, 2500.0)]


@pytest.mark.parametrize("home", HOMES)
def test_against_pymap3d(home):
    rng = np.random.default_rng(1)
    for position in rng.uniform(-5000.0, 5000.0, (50, 3)):
        expected = pymap3d.enu2geodetic(*position, *home)
        latitude, longitude, height = geodesy.enu_to_geodetic(home, tuple(position))
        assert latitude == pytest.approx(float(expected[0]), abs=1e-9)
        assert (longitude - float(expected[1]) + 180.0) % 360.0 == pytest.approx(180.0, abs=1e-9)
        assert height == pytest.approx(float(expected[2]), abs=1e-6)
        back = geodesy.geodetic_to_enu(home, latitude, longitude, height)
        np.testing.assert_allclose(back, position, atol=1e-7)
        np.testing.assert_allclose(back, pymap3d.geodetic2enu(latitude, longitude, height, *home), atol=1e-6)


@pytest.mark.parametrize("home", HOMES)
@pytest.mark.parametrize(("reach", "up"), [(2e3, 500.0), (1e5, 20e3)])
def test_barometer_air_and_gps_have_one_height(home, reach, up):
    rng = np.random.default_rng(2)
    for position in rng.uniform((-reach, -reach, -300.0), (reach, reach, up), (300, 3)) * (0.7, 0.7, 1.0):
        height = geodesy.height_above_home(home, tuple(position))
        assert height == pytest.approx(float(pymap3d.enu2geodetic(*position, *home)[2]) - home.height, abs=0.1)


def test_height_is_that_above_the_plane_near_home_and_continuous():
    home, edge = Home(), geodesy.FLAT
    inside, outside = (geodesy.height_above_home(home, (0.0, r, 7.0)) for r in (edge, edge * (1.0 + 1e-12)))
    assert (inside, outside) == (7.0, pytest.approx(7.0, abs=1e-9))


def test_directions():
    """A step north raises the latitude, east the longitude, up the height."""
    home = Home()
    assert geodesy.enu_to_geodetic(home, (0.0, 0.0, 0.0)) == pytest.approx(tuple(home), abs=1e-9)
    assert geodesy.enu_to_geodetic(home, (0.0, 100.0, 0.0))[0] > home.latitude_deg + 8e-4
    assert geodesy.enu_to_geodetic(home, (100.0, 0.0, 0.0))[1] > home.longitude_deg + 8e-4
    assert geodesy.enu_to_geodetic(home, (0.0, 0.0, 7.0))[2] == pytest.approx(home.height + 7.0, abs=1e-6)


def test_normal_gravity_at_equator_and_poles():
    """NIMA TR8350.2, table 3.4."""
    assert geodesy.normal_gravity(0.0) == 9.7803253359
    assert geodesy.normal_gravity(90.0) == pytest.approx(9.8321849378, abs=2e-10)
    assert geodesy.normal_gravity(-90.0) == geodesy.normal_gravity(90.0)
