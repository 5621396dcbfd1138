"""The International Standard Atmosphere up to 20 km, optionally with another sea-level pressure or temperature.

ISO 2533:1975; theory, eqs. (2.3) and (3.8).
"""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Le

from lapwing.dynamics.constants import STANDARD_GRAVITY
from lapwing.kernels import always_inline, math

EARTH_RADIUS = 6_356_766.0  # [m] converts geometric to geopotential altitude
GAS_CONSTANT = 287.05287  # [J/(kg K)] of dry air
SEA_LEVEL_TEMPERATURE = 288.15  # [K]
LAPSE_RATE = 0.0065  # [K/m] up to the tropopause, none above it
TROPOPAUSE = 11_000.0  # [m] geopotential
EXPONENT = STANDARD_GRAVITY / (GAS_CONSTANT * LAPSE_RATE)  # 5.2559
FREEZING = 273.15  # [K] at 0 degC
# ((1 - u)**EXPONENT - 1) / u for -0.1 <= u <= 0.32, from 4 km below the sea to the tropopause: minimax polynomial of
# relative error 3e-16, faster than `pow` (recomputed in tests/dynamics/test_atmosphere.py)
LAPSE_POLYNOMIAL = (
    -5.255879812716677, 11.184196396503008, -12.138133089610943, 6.845542350230893, -1.7194356889414584,
    0.07332814684628898, 0.007794992951589544, 0.0016994459544154605, 0.0005180868469204319,
    0.0001933830602118856, 8.976930648030865e-05, 1.928633569001961e-05, 5.133379122576114e-05,
)  # fmt: skip


class Atmosphere(NamedTuple):
    """Atmosphere of a day in hydrostatic balance, with a constant temperature offset from the standard."""

    sea_level_pressure: Annotated[float, Ge(85e3), Le(110e3)] = 101_325.0  # [Pa] pressure at sea level
    temperature_offset: Annotated[float, Ge(-60), Le(60)] = 0.0  # [K] offset from the standard's 15 degC at sea level


@always_inline
def _geopotential(altitude):
    return EARTH_RADIUS * altitude / (EARTH_RADIUS + altitude)


@always_inline
def temperature(a, altitude):
    """Return the temperature [K] at an altitude [m] above sea level."""
    return SEA_LEVEL_TEMPERATURE + a.temperature_offset - LAPSE_RATE * min(_geopotential(altitude), TROPOPAUSE)


@always_inline
def _lapse_factor(u):
    """Return (1 - u)**EXPONENT."""
    c, z = LAPSE_POLYNOMIAL, u * u
    low = (c[0] + c[1] * u) + z * (c[2] + c[3] * u)
    middle = (c[4] + c[5] * u) + z * (c[6] + c[7] * u)
    high = (c[8] + c[9] * u) + z * (c[10] + c[11] * u)
    fourth = z * z
    return 1.0 + u * (low + fourth * (middle + fourth * (high + fourth * c[12])))


@always_inline
def pressure(a, altitude):
    """Return the pressure [Pa] at an altitude [m] above sea level."""
    height, ground = _geopotential(altitude), SEA_LEVEL_TEMPERATURE + a.temperature_offset
    result = a.sea_level_pressure * _lapse_factor(LAPSE_RATE * min(height, TROPOPAUSE) / ground)
    if height > TROPOPAUSE:
        kelvin = ground - LAPSE_RATE * TROPOPAUSE
        result = result * math.exp((TROPOPAUSE - height) * STANDARD_GRAVITY / (GAS_CONSTANT * kelvin))
    return result


@always_inline
def density(a, altitude):
    """Return the density [kg/m^3] at an altitude [m] above sea level."""
    return pressure(a, altitude) / (GAS_CONSTANT * temperature(a, altitude))


@always_inline
def density_slope(a, altitude):
    """Return the change of density with altitude [kg/m^4]."""
    lapse = LAPSE_RATE if _geopotential(altitude) < TROPOPAUSE else 0.0
    weaker = EARTH_RADIUS / (EARTH_RADIUS + altitude)
    return density(a, altitude) * (lapse - STANDARD_GRAVITY / GAS_CONSTANT) * weaker * weaker / temperature(a, altitude)


@always_inline
def pressure_altitude(a, pressure_now):
    """Return the altitude [m] above sea level with this pressure [Pa]; inverse of `pressure`."""
    ground = SEA_LEVEL_TEMPERATURE + a.temperature_offset
    height = ground * (1.0 - math.pow(pressure_now / a.sea_level_pressure, 1.0 / EXPONENT)) / LAPSE_RATE
    if height > TROPOPAUSE:
        kelvin = ground - LAPSE_RATE * TROPOPAUSE
        at_tropopause = a.sea_level_pressure * math.pow(kelvin / ground, EXPONENT)
        height = TROPOPAUSE + math.log(at_tropopause / pressure_now) * GAS_CONSTANT * kelvin / STANDARD_GRAVITY
    return EARTH_RADIUS * height / (EARTH_RADIUS - height)


@always_inline
def share_of_squares(shares, velocity_body):
    """Return a static pressure position error over half the density [m^2/s^2] (theory, eq. (3.65)).

    Args:
        shares: of the dynamic pressure, in flight forwards, backwards, to the right, to the left and vertically.
        velocity_body: velocity through the air [m/s] in FLU.
    """
    forward, backward, right, left, vertical = shares
    x, y, z = velocity_body
    along = (forward if x > 0.0 else backward) * x * x
    across = (left if y > 0.0 else right) * y * y
    return along + across + vertical * z * z
