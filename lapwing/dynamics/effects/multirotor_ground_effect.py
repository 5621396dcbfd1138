"""Ground effect of all rotors together, also over a part of their area."""

from typing import Annotated, Any, NamedTuple

from annotated_types import Ge, Le

from lapwing.dynamics.effects._axes import hub_speeds
from lapwing.dynamics.effects._from_scene import Airframe, reject, validate_table
from lapwing.dynamics.effects._hooks import is_sleeping, load_factors
from lapwing.dynamics.effects._types import Factors
from lapwing.dynamics.effects.ground_effect import KIND
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.terrain import LEVEL, Level, over_plane, summit, surface, upright
from lapwing.dynamics.vector import pair
from lapwing.dynamics.vehicles.propeller import hover_flow
from lapwing.kernels import always_inline, math, noinline
from lapwing.kernels.codegen import map_tuple

__all__ = ["KIND", "MultirotorGroundEffect", "Settings"]

LOWEST = 0.5  # radii: lower limit of the height in the law
FADE_FROM, FADE_TO = 8.0, 12.0  # radii over which the remaining effect, about 1 %, is faded out
MOST = 0.5  # limit of the share of a rotor's flow that images cancel
INNER, OUTER = 0.5, math.sqrt(0.75)  # radii of rings that halve a disc's area, over its radius
SLANT = math.sqrt(0.5)
# points of a disc, over its radius, that represent equal areas
SPREAD = tuple((INNER * x, INNER * y) for x, y in ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))) + tuple(
    (OUTER * SLANT * x, OUTER * SLANT * y) for x, y in ((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0))
)
CENTRE: tuple[tuple[float, float], ...] = ((0.0, 0.0),)


class Settings(NamedTuple):
    """Scene table."""

    fountain: Annotated[float, Ge(0), Le(4)] = 2.0  # K_b, coefficient of the fountain between the rotors


class MultirotorGroundEffect(NamedTuple):
    """Thrust of each rotor over 1 - s, the share of its flow that the images of all rotors cancel (theory, eq.
    (2.67), (2.68)).

    Source: Sanchez-Cuevas, Heredia and Ollero, Int. J. Aerospace Engineering 2017, 1823056: method of images, and a
    measured coefficient of the fountain between rotors; fades with forward speed as in Cheeseman and Bennett, ARC R&M
    3021 (1955). Valid for heights above half a radius. Over an edge, equal areas of each disc count with the height of
    the ground below them.
    """

    radius: float  # [m]
    lowest: float  # [m] least height of a disc
    flow: float  # [m/rad] induced velocity in hover over the rotor's speed
    fountain: float  # [m^2] 2 R^2 K_b
    diagonal: float  # [m^2] square of the largest distance between rotors
    pairs: tuple[tuple[tuple[float, float], ...], ...]  # for each rotor and other: squared distance [m^2], share of b
    highest: float  # [m] height of the centre of mass over the slope above which the effect is zero
    spread: tuple[tuple[float, float], ...] = CENTRE  # [m] points of a disc below which the ground's height is sampled
    terrain: Any = LEVEL  # Level or Relief

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "MultirotorGroundEffect":
        """Return the parameters of the airframe's propellers over level ground."""
        settings = validate_table(Settings, table)
        propeller = airframe.propeller or reject("the vehicle has no [propeller]")
        radius, places = 0.5 * propeller.diameter, airframe.rotors.position
        share = 1.0 / (len(places) - 1)
        pairs = tuple(tuple((_square(a, b), 0.0 if a is b else share) for b in places) for a in places)
        diagonal = max(square for row in pairs for square, _ in row)
        reach = max(math.hypot(*place) for place in places)
        fountain = 2.0 * radius * radius * settings.fountain
        return cls(radius, LOWEST * radius, hover_flow(propeller), fountain, diagonal, pairs, FADE_TO * radius + reach)

    def in_environment(self, environment: Environment) -> "MultirotorGroundEffect":
        """Return the effect over the scene's terrain."""
        stretch = math.hypot(*upright(environment.terrain))
        spread = CENTRE
        if not isinstance(environment.terrain, Level):
            spread = tuple((self.radius * x, self.radius * y) for x, y in SPREAD)
        return self._replace(highest=self.highest * stretch, spread=spread, terrain=environment.terrain)


def _square(a: tuple[float, float, float], b: tuple[float, float, float]) -> float:
    """Return the squared distance of two rotors' axes [m^2]."""
    return math.square(a[0] - b[0]) + math.square(a[1] - b[1])


@always_inline
def _height(c, at, _):
    """Return the height [m] of a place on a disc over the ground below it."""
    e, s, (x, y, z) = c
    R, (px, py, pz) = s.R_world_body, s.motion.position_world
    u, v = x + at[0], y + at[1]
    ground, _ = surface(e.terrain, px + R[0] * u + R[1] * v + R[2] * z, py + R[3] * u + R[4] * v + R[5] * z)
    return max(pz + R[6] * u + R[7] * v + R[8] * z - ground, e.lowest)


@noinline
def _heights(c, plan, z):
    e, s = c
    return map_tuple(_height, (e, s, (plan[0], plan[1], z)), e.spread, e.spread)


@always_inline
def _height_share(e, z):
    """Return the share of the law that is left at a height [m]."""
    fade = min(max((z / e.radius - FADE_FROM) * (1.0 / (FADE_TO - FADE_FROM)), 0.0), 1.0)
    return 1.0 - fade * fade * (3.0 - 2.0 * fade)


@noinline
def _flow_reduction(c, row, own):
    """Return the share of a rotor's flow that images cancel, in hover."""
    e, heights = c
    result = 0.0
    for j in range(len(row)):
        square, share = row[j]
        other = heights[j]
        for k in range(len(own)):
            h = own[k] + other[k]
            image, body = square + h * h, e.diagonal + h * h
            part = 0.25 * e.radius * e.radius * h / (image * math.sqrt(image))
            part += share * e.fountain * 0.5 * h / (body * math.sqrt(body))
            result += part * _height_share(e, 0.5 * h)
    return result / len(own)


@always_inline
def _speed_share(e, speed, hub):
    """Return the share of the effect that is left at a speed across (Cheeseman and Bennett)."""
    m = hub[1] / max(e.flow * speed, 1e-3)  # over the induced velocity in hover
    half = 0.5 * m * m
    through = math.sqrt(half * half + 1.0) - half  # squared induced velocity in forward flight, over that in hover
    return through / (through + m * m)


@always_inline
def _multiply_gain(_, factor, both):
    return factor / (1.0 - min(both[0] * both[1], MOST))


@load_factors(MultirotorGroundEffect)
def multirotor_ground_effect(e, memory, s, before):
    """Multiply the thrust factors; torque is unchanged."""
    plan = map_tuple(pair, 0.0, s.layout.x_body, s.layout.y_body)
    heights = map_tuple(_heights, (e, s), plan, s.layout.z_body)
    cancelled = map_tuple(_flow_reduction, (e, heights), e.pairs, heights)
    calmed = map_tuple(_speed_share, e, s.motion.rotor_speed, hub_speeds(s))
    return Factors(
        map_tuple(_multiply_gain, 0.0, before.thrust, map_tuple(pair, 0.0, cancelled, calmed)), before.torque
    )


@is_sleeping(MultirotorGroundEffect)
def high(e, motion, h):
    """Return True if no rotor can reach the ground effect within a step."""
    over, climb = over_plane(e.terrain, motion.position_world), over_plane(e.terrain, motion.velocity_world)
    return over - summit(e.terrain) + 2.0 * h * min(climb, 0.0) > e.highest
