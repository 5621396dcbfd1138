"""Steady wind."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Le

from lapwing.dynamics.effects._external_inputs import all_given_or, external, initial_state
from lapwing.dynamics.effects._hooks import air
from lapwing.dynamics.effects._types import Air
from lapwing.dynamics.vector import Vec3, add
from lapwing.kernels import math

Speed = Annotated[float, Ge(-60), Le(60)]


class WindConstant(NamedTuple):
    """Uniform constant wind (theory, eq. (2.18)).

    It acts through the effects that use the air velocity.
    Valid well above the ground's boundary layer.
    """

    velocity: tuple[Speed, Speed, Speed]  # [m/s] velocity of the air, world

    def with_inputs(self) -> "ExternalWindConstant":
        """Return the wind with named inputs."""
        return ExternalWindConstant(self)


class WindInputs(NamedTuple):
    """Named inputs of a wind; NaN: the velocity of the scene."""

    velocity: Vec3 = (math.nan, math.nan, math.nan)  # [m/s] world


@external
class ExternalWindConstant(NamedTuple):
    """Wind from an external model, uniform in space and constant during a communication step."""

    own: WindConstant
    inputs: WindInputs = WindInputs()

    def initial_discrete_state(self) -> tuple:
        """Return () and the inputs."""
        return initial_state(self)


@air(WindConstant)
def wind_constant(e, memory, s, before):
    """Add this wind to the air."""
    return Air(before.density, add(before.wind_world, e.velocity))


@air(ExternalWindConstant)
def external_wind(e, memory, s, before):
    """Add the external wind to the air."""
    return Air(before.density, add(before.wind_world, all_given_or(e.own.velocity, memory[1].velocity)))
