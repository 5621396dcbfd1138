"""Environment of a flight: place, atmosphere, gravity, magnetic field and terrain."""

import datetime
from typing import Any, NamedTuple

from lapwing.dynamics.atmosphere import Atmosphere
from lapwing.dynamics.constants import STANDARD_GRAVITY
from lapwing.dynamics.geodesy import Home
from lapwing.dynamics.terrain import LEVEL
from lapwing.dynamics.vector import Vec3

FIRST_YEAR, LAST_YEAR = 2010, 2029  # range of the available World Magnetic Models
TESLA = 1e-9  # [T] 1 nT
DIGITS = 10  # decimal places of a field in tesla: 0.1 nT, as in the model's tables


class Environment(NamedTuple):
    """Environment shared by all services of a run; the defaults are those of a scene without `[environment]`."""

    home: Home = Home()
    atmosphere: Atmosphere = Atmosphere()
    gravity: float = STANDARD_GRAVITY  # [m/s^2] at sea level
    magnetic_field_world: Vec3 = (1.8611e-6, 25.1776e-6, -39.2545e-6)  # [T] world; at the default home on 1 July 2025
    terrain: Any = LEVEL  # Level or Relief


def magnetic_field(home: Home, date: datetime.date) -> Vec3:
    """Return the Earth's field at home [T], east, north, up, by the World Magnetic Model.

    Args:
        home: position on the Earth.
        date: date from FIRST_YEAR to LAST_YEAR.
    """
    from pygeomag import GeoMag

    first = datetime.date(date.year, 1, 1)
    year = date.year + (date - first).days / (datetime.date(date.year + 1, 1, 1) - first).days
    model = GeoMag(base_year=date.year)
    result = model.calculate(home.latitude_deg, home.longitude_deg, home.height / 1000.0, year)
    return round(result.y * TESLA, DIGITS), round(result.x * TESLA, DIGITS), round(-result.z * TESLA, DIGITS)


STANDARD = Environment()
