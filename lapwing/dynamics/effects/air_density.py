"""Air density as a function of altitude."""

from typing import NamedTuple

from lapwing.dynamics.atmosphere import Atmosphere, density, density_slope
from lapwing.dynamics.effects._from_scene import Airframe, validate_table
from lapwing.dynamics.effects._hooks import air, discrete_update
from lapwing.dynamics.effects._types import Air
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.geodesy import Home, height_above_home
from lapwing.dynamics.vector import ZERO
from lapwing.kernels import always_inline, python_function


class Settings(NamedTuple):
    """No keys: the air and the altitude of home are in [environment]."""


class AirDensity(NamedTuple):
    """Density of the scene's atmosphere at the vehicle's altitude (theory, eq. (2.3)).

    Linear in altitude within a communication step.
    Source: the International Standard Atmosphere, ISO 2533:1975. Valid to 20 km above the sea.
    """

    atmosphere: Atmosphere = Atmosphere()
    home: Home = Home(height=0.0)

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "AirDensity":
        """Return the standard atmosphere at sea level."""
        validate_table(Settings, table)
        return cls()

    def in_environment(self, environment: Environment) -> "AirDensity":
        """Return the atmosphere at the scene's place and time."""
        return AirDensity(environment.atmosphere, environment.home)

    def initial_discrete_state(self) -> tuple[float, float]:
        """Return the tangent at home."""
        return python_function(_tangent)(self, ZERO)


@always_inline
def _tangent(e, position_world):
    altitude = e.home.height + height_above_home(e.home, position_world)
    slope = density_slope(e.atmosphere, altitude)
    return (density(e.atmosphere, altitude) - slope * position_world[2], slope)


@discrete_update(AirDensity)
def tangent(e, memory, s, rotors, key, tick, interval):
    """Return (density [kg/m^3], slope [kg/m^4]) of the tangent at the vehicle's height, with the density at z = 0.

    Over an interval the height changes by centimetres: the tangent is within 1e-9 of the law, at a tenth of the cost.
    """
    return _tangent(e, s.motion.position_world)


@air(AirDensity)
def air_density(e, memory, s, before):
    """Return the air at the vehicle's altitude."""
    return Air(memory[0] + memory[1] * s.motion.position_world[2], before.wind_world)
