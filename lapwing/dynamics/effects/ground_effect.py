"""Ground effect of single rotors."""

from typing import Any, NamedTuple

from lapwing.dynamics.effects._from_scene import Airframe, reject, validate_table
from lapwing.dynamics.effects._hooks import is_sleeping, load_factors
from lapwing.dynamics.effects._types import Factors
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.terrain import LEVEL, over_plane, summit, surface, upright
from lapwing.kernels import always_inline, math
from lapwing.kernels.codegen import map_tuple

KIND = "ground effect model"
LOWEST = 0.5  # radii: lower limit of the height in the law
FADE_FROM, FADE_TO = 4.0, 8.0  # radii over which the remaining effect, below 0.4 %, is faded out


class Settings(NamedTuple):
    """No keys: the parameters are in the airframe's [propeller]."""


class GroundEffect(NamedTuple):
    """Thrust of each rotor over 1 - (R / 4 z)^2 at its height z above the ground (theory, eq. (2.25)).

    Source: Cheeseman and Bennett, ARC R&M 3021 (1955), for an isolated rotor in hover. Valid
    for heights above half a radius, over ground that is flat for some radii around.
    """

    inverse_radius: float  # [1/m]
    highest: float  # [m] height of the centre of mass over the slope above which the effect is zero
    terrain: Any = LEVEL  # Level or Relief

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "GroundEffect":
        """Return the parameters of the airframe's propeller."""
        validate_table(Settings, table)
        propeller = airframe.propeller or reject("the vehicle has no [propeller]")
        radius = 0.5 * propeller.diameter
        reach = max(math.hypot(*position) for position in airframe.rotors.position)
        return cls(1.0 / radius, FADE_TO * radius + reach)

    def in_environment(self, environment: Environment) -> "GroundEffect":
        """Return the effect over the scene's terrain."""
        stretch = math.hypot(*upright(environment.terrain))
        return self._replace(highest=self.highest * stretch, terrain=environment.terrain)


@always_inline
def gain(height):
    """Return the thrust over that out of ground effect, at a height in radii."""
    z = max(height, LOWEST)
    square = 0.0625 / (z * z)
    fade = min(max((z - FADE_FROM) * (1.0 / (FADE_TO - FADE_FROM)), 0.0), 1.0)
    return 1.0 + square / (1.0 - square) * (1.0 - fade * fade * (3.0 - 2.0 * fade))


@always_inline
def _height(c, x, y):
    e, s = c
    R, (px, py, pz) = s.R_world_body, s.motion.position_world
    ground, _ = surface(e.terrain, px + R[0] * x + R[1] * y, py + R[3] * x + R[4] * y)
    return e.inverse_radius * (pz + R[6] * x + R[7] * y - ground)


@always_inline
def _multiply_gain(_, factor, height):
    return factor * gain(height)


@load_factors(GroundEffect)
def ground_effect(e, memory, s, before):
    """Multiply the thrust factors; torque is unchanged."""
    heights = map_tuple(_height, (e, s), s.layout.x_body, s.layout.y_body)
    return Factors(map_tuple(_multiply_gain, 0.0, before.thrust, heights), before.torque)


@is_sleeping(GroundEffect)
def high(e, motion, h):
    """Return True if no rotor can reach the ground effect within a step."""
    over, climb = over_plane(e.terrain, motion.position_world), over_plane(e.terrain, motion.velocity_world)
    return over - summit(e.terrain) + 2.0 * h * min(climb, 0.0) > e.highest
