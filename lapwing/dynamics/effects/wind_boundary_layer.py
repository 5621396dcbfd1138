"""Wind that increases with height above the ground."""

from typing import Annotated, Any, NamedTuple

from annotated_types import Ge, Gt, Le

from lapwing.dynamics.effects._from_scene import Airframe, validate_table
from lapwing.dynamics.effects._hooks import air
from lapwing.dynamics.effects._types import Air
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.terrain import LEVEL, surface
from lapwing.kernels import math


class Settings(NamedTuple):
    """Scene table."""

    speed: Annotated[float, Gt(0), Le(60)]  # [m/s] at the reference height
    direction_to: Annotated[float, Ge(-2.0 * math.pi), Le(2.0 * math.pi)] = 0.0  # [rad] of the air's motion, from east
    height: Annotated[float, Ge(1), Le(200)] = 10.0  # [m] over the ground, of reference
    roughness: Annotated[float, Ge(1e-5), Le(3)] = 0.03  # [m] length: sea 0.0002, mown grass 0.01, crops 0.1, town 1


class WindBoundaryLayer(NamedTuple):
    """Steady wind with the logarithmic profile of the neutral surface layer (theory, eq. (2.32)).

    Source: Stull, An Introduction to Boundary Layer Meteorology (1988), section 9.7. Valid to about 100 m over ground
    of uniform roughness, not between obstacles.
    """

    along: tuple[float, float]  # [m/s] world x and y of the wind, a factor e over the roughness length
    inverse_roughness: float  # [1/m]
    terrain: Any = LEVEL  # Level or Relief

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "WindBoundaryLayer":
        """Return the parameters over level ground."""
        settings = validate_table(Settings, table)
        scale = settings.speed / math.log1p(settings.height / settings.roughness)
        return cls(
            (scale * math.cos(settings.direction_to), scale * math.sin(settings.direction_to)), 1.0 / settings.roughness
        )

    def in_environment(self, environment: Environment) -> "WindBoundaryLayer":
        """Return the effect over the scene's terrain."""
        return self._replace(terrain=environment.terrain)


@air(WindBoundaryLayer)
def wind_boundary_layer(e, memory, s, before):
    """Add this wind to the air."""
    x, y, z = s.motion.position_world
    height = max(z - surface(e.terrain, x, y)[0], 0.0)
    growth = math.log(1.0 + height * e.inverse_roughness)
    wind = before.wind_world
    return Air(before.density, (wind[0] + growth * e.along[0], wind[1] + growth * e.along[1], wind[2]))
