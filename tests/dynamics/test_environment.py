"""Magnetic field against NOAA's published test values of the World Magnetic Model."""

import datetime

import pytest

from lapwing.dynamics.environment import STANDARD, magnetic_field
from lapwing.dynamics.geodesy import Home

# WMM2025_TEST_VALUES.txt: date, height [km], latitude, longitude [deg], north, east, down [nT]
TABLE = [
    (2025.0, 0.0, 80.0, 0.0, 6521.6, 145.9, 54791.5),
    (2025.0, 0.0, 0.0, 120.0, 39677.8, -109.6, -10580.2),
    (2025.0, 0.0, -80.0, -120.0, 6117.5, 15751.9, -52022.5),
    (2027.5, 0.0, 80.0, 0.0, 6500.8, 294.5, 54869.4),
    (2027.5, 0.0, 0.0, 120.0, 39701.6, -167.4, -10381.8),
    (2027.5, 0.0, -80.0, -120.0, 6200.7, 15730.3, -51783.7),
    (2020.0, 0.0, 80.0, 0.0, 6570.4, -146.3, 54606.0),  # WMM2020testvalues
    (2022.5, 0.0, 0.0, 120.0, 39684.7, -42.2, -10809.5),
]


@pytest.mark.parametrize(("year", "height", "latitude", "longitude", "north", "east", "down"), TABLE)
def test_published_values(year, height, latitude, longitude, north, east, down):
    day = datetime.date(int(year), 7, 2) if year % 1.0 else datetime.date(int(year), 1, 1)
    result = magnetic_field(Home(latitude, longitude, 1000.0 * height), day)
    # the middle of a year falls between two days: a change of 80 nT a year makes 0.2 nT of half a day
    assert result == pytest.approx((1e-9 * east, 1e-9 * north, -1e-9 * down), abs=0.3e-9)


def test_default_is_field_of_default_place_and_day():
    assert magnetic_field(STANDARD.home, datetime.date(2025, 7, 1)) == pytest.approx(STANDARD.magnetic_field_world)
