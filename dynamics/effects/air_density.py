"""Air density that falls with altitude."""

from typing import TYPE_CHECKING, Annotated, NamedTuple

from annotated_types import Ge, Le

from dynamics.effects._hooks import air, sample
from dynamics.effects._scene import checked
from dynamics.effects._types import Air

if TYPE_CHECKING:  # a process that flies has no need of pydantic
    from dynamics.vehicles.airframe import Airframe

KELVIN = 273.0  # [K] at 0 degC, as the paper rounds it
LAPSE_RATE = 0.0065  # [K/m]
EXPONENT = 5.2561
SEA_LEVEL_DENSITY = 1.293  # [kg/m^3] at 0 degC and 1 atm


ORDER = 6  # of the series


class Settings(NamedTuple):
    """What a scene says."""

    temperature: Annotated[float, Ge(-60), Le(60)] = 15.0  # [degC] at the ground
    home_altitude: Annotated[float, Ge(-500), Le(9000)] = 0.0  # [m] of the world frame's origin above the sea


class AirDensity(NamedTuple):
    """Density from temperature and altitude (theory.md, eq. (2.3)), by the series of its power law about home; between
    exchanges by the tangent.

    Source: Pappalardo et al. 2023, section 2.6 (the barometric formula of the International Standard Atmosphere, but
    with the temperature at the ground also aloft). Valid to 11 km above the sea; the series is within 1e-12 of the
    power law 500 m from home and within 3e-9 at 5 km.
    """

    series: tuple[float, ...]  # [kg/m^3], [kg/m^4], ... in powers of the height above home

    @classmethod
    def from_scene(cls, table: dict, airframe: "Airframe") -> "AirDensity":
        """Taylor coefficients of rho_0 (1 - L (h + z) / T)^n in z."""
        settings = checked(Settings, table)
        kelvin = KELVIN + settings.temperature
        base = 1.0 - LAPSE_RATE * settings.home_altitude / kelvin
        coefficients = [SEA_LEVEL_DENSITY * KELVIN / kelvin * base**EXPONENT]
        for k in range(ORDER):
            coefficients.append(-coefficients[-1] * (EXPONENT - k) / (k + 1) * LAPSE_RATE / (kelvin * base))
        return cls(tuple(coefficients))

    def initial_memory(self) -> tuple[float, float]:
        """The tangent at home."""
        return (self.series[0], self.series[1])


@sample(AirDensity)
def tangent(e, memory, s, rotors, key, tick, interval):
    """(density [kg/m^3], slope [kg/m^4]) of the tangent to the law at the vehicle's height, given at z = 0.

    Over an interval the height changes by centimetres: the tangent is within 1e-9 of the law, at a tenth of the cost.
    """
    c, z = e.series, s.motion.position_world[2]
    value, slope = c[6], 0.0
    for k in range(5, -1, -1):
        slope = slope * z + value
        value = value * z + c[k]
    return (value - slope * z, slope)


@air(AirDensity)
def air_density(e, memory, s, before):
    """Air at the vehicle's altitude."""
    return Air(memory[0] + memory[1] * s.motion.position_world[2], before.wind_world)
