"""Atmosphere against published tables and the hydrostatic balance."""

import pytest
from mpmath import mp, mpf

from lapwing.dynamics import atmosphere
from lapwing.dynamics.atmosphere import Atmosphere, density, density_slope, pressure, pressure_altitude, temperature
from lapwing.kernels.math.coefficients import remez

STANDARD, WARM = Atmosphere(), Atmosphere(99_000.0, 20.0)

# U.S. Standard Atmosphere 1976, table I, by geometric altitude [m]: [K], [Pa], [kg/m^3]
TABLE = [
    (0.0, 288.150, 101_325.0, 1.2250),
    (1000.0, 281.651, 89_876.0, 1.1117),
    (2000.0, 275.154, 79_501.0, 1.0066),
    (3000.0, 268.659, 70_121.0, 0.90925),
    (5000.0, 255.676, 54_048.0, 0.73643),
    (8000.0, 236.215, 35_651.0, 0.52579),
    (10_000.0, 223.252, 26_499.0, 0.41351),
    (12_000.0, 216.650, 19_399.0, 0.31194),
    (15_000.0, 216.650, 12_112.0, 0.19476),
    (20_000.0, 216.650, 5529.3, 0.088910),
]


@pytest.mark.parametrize(("altitude", "kelvin", "pascal", "rho"), TABLE)
def test_published_table(altitude, kelvin, pascal, rho):
    assert temperature(STANDARD, altitude) == pytest.approx(kelvin, abs=2e-3)
    assert pressure(STANDARD, altitude) == pytest.approx(pascal, rel=5e-5)
    assert density(STANDARD, altitude) == pytest.approx(rho, rel=1e-4)


@pytest.mark.parametrize("air", [STANDARD, WARM])
@pytest.mark.parametrize("altitude", [0.0, 280.0, 5000.0, 15_000.0])
def test_pressure_carries_air_above(air, altitude):
    """dp/dz = -rho g on every day."""
    slope = (pressure(air, altitude + 1.0) - pressure(air, altitude - 1.0)) / 2.0
    gravity = 9.80665 * (6_356_766.0 / (6_356_766.0 + altitude)) ** 2
    assert slope == pytest.approx(-density(air, altitude) * gravity, rel=1e-6)


@pytest.mark.parametrize("air", [STANDARD, WARM])
@pytest.mark.parametrize("altitude", [-300.0, 0.0, 280.0, 3000.0, 10_900.0, 11_500.0, 19_000.0])
def test_altitude_from_pressure_and_back(air, altitude):
    assert pressure_altitude(air, pressure(air, altitude)) == pytest.approx(altitude, abs=1e-6)
    slope = (density(air, altitude + 1.0) - density(air, altitude - 1.0)) / 2.0
    assert density_slope(air, altitude) == pytest.approx(slope, rel=1e-6)


def test_warm_day_is_thin_and_high_pressure_dense():
    assert density(WARM, 0.0) == pytest.approx(99_000.0 / (287.05287 * 308.15), rel=1e-12)
    assert temperature(WARM, 15_000.0) == pytest.approx(236.65)


def test_polynomial_of_lapse_is_minimax():
    with mp.workprec(300):
        exponent = mpf(atmosphere.EXPONENT)

        def function(u):
            return ((1 - u) ** exponent - 1) / u if abs(u) > mpf("1e-30") else -exponent

        assert tuple(remez(function, 13, mpf("-0.1"), mpf("0.32"))) == atmosphere.LAPSE_POLYNOMIAL


@pytest.mark.parametrize("altitude", [-4000.0, -400.0, 0.0, 1e-9, 35.0, 1500.0, 8848.0, 11_000.0])
@pytest.mark.parametrize("offset", [-60.0, 0.0, 60.0])
def test_pressure_of_troposphere_is_power_of_temperature(altitude, offset):
    air = Atmosphere(temperature_offset=offset)
    with mp.workprec(200):
        radius = mpf(atmosphere.EARTH_RADIUS)
        height = radius * mpf(altitude) / (radius + mpf(altitude))
        ratio = 1 - mpf(atmosphere.LAPSE_RATE) * height / (mpf(atmosphere.SEA_LEVEL_TEMPERATURE) + mpf(offset))
        expected = mpf(air.sea_level_pressure) * ratio ** mpf(atmosphere.EXPONENT)
    assert pressure(air, altitude) == pytest.approx(float(expected), rel=1e-15)
