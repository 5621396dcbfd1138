"""Steady wind."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Le

from lapwing.dynamics.effects._hooks import air
from lapwing.dynamics.effects._types import Air
from lapwing.dynamics.vector import add

Speed = Annotated[float, Ge(-60), Le(60)]


class WindConstant(NamedTuple):
    """Uniform constant wind (theory.md, eq. (2.18)); it acts through the effects that use the air's velocity.

    Valid well above the ground's boundary layer.
    """

    velocity: tuple[Speed, Speed, Speed]  # [m/s] world: where the air goes to


@air(WindConstant)
def wind_constant(e, memory, s, before):
    """Add this wind to the air."""
    return Air(before.density, add(before.wind_world, e.velocity))
