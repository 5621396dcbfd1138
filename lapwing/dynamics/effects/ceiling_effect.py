"""Thrust increase below a ceiling."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt, Le

from lapwing.dynamics.effects._from_scene import Airframe, pitch_and_flow, reject, validate_table
from lapwing.dynamics.effects._hooks import is_sleeping, load_factors
from lapwing.dynamics.effects._types import Factors
from lapwing.dynamics.vector import first, norm, pair, product, second
from lapwing.dynamics.vehicles.propeller import thrust_constant, torque_constant
from lapwing.kernels import always_inline, math, noinline
from lapwing.kernels.codegen import map_tuple

LOWEST = 0.25  # radii: lower limit of the distance in the law
FADE_FROM, FADE_TO = 4.0, 8.0  # radii over which the remaining effect, below 0.2 %, is faded out
UNBOUNDED = 1e9  # [m]

Length = Annotated[float, Gt(0), Le(1e6)]
Place = Annotated[float, Ge(-1e6), Le(1e6)]


class Settings(NamedTuple):
    """Scene table."""

    height: Annotated[float, Gt(0), Le(1e5)]  # [m] world z of the ceiling
    centre: tuple[Place, Place] = (0.0, 0.0)  # [m] world x and y of its middle
    size: tuple[Length, Length] | None = None  # [m] along world x and y; without bounds if left out
    asymmetry: Annotated[float, Ge(0), Le(4)] = 1.0  # alpha_0 of the inflow; 1 for an even one


class CeilingEffect(NamedTuple):
    """Change of thrust and torque by a ceiling that reduces the induced flow (theory, eq. (2.69), (2.70)).

    Source: Hsiao and Chirarattananon, IEEE/ASME Trans. Mechatronics 24 (2019) 2316, momentum theory of the induced
    power, without recirculation; blades of one pitch as in `dynamic_inflow`. Valid in hover for distances above a
    quarter of a radius, below a level ceiling; the vehicle does not collide with it.
    """

    inverse_radius: float  # [1/m]
    height: float  # [m]
    centre: tuple[float, float]  # [m]
    half_size: tuple[float, float]  # [m]
    asymmetry: float
    pitch: float  # of the blades over the induced velocity in hover, both over the rotor's speed; above 1
    induced: float  # induced part of the static torque
    reach: float  # [m] distance of the centre of mass from the ceiling within which it has an effect

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "CeilingEffect":
        """Return the parameters of the airframe's propeller."""
        settings = validate_table(Settings, table)
        propeller = airframe.propeller or reject("the vehicle has no [propeller]")
        radius, (pitch, flow) = 0.5 * propeller.diameter, pitch_and_flow(propeller)
        static, torque = thrust_constant(propeller), torque_constant(propeller)
        length, width = settings.size or (UNBOUNDED, UNBOUNDED)
        reach = FADE_TO * radius + max(math.hypot(*place) for place in airframe.rotors.position)
        return cls(
            1.0 / radius, settings.height, settings.centre, (0.5 * length, 0.5 * width), settings.asymmetry,
            pitch / flow, min(static * flow / torque, 1.0), reach,
        )  # fmt: skip


@always_inline
def _inside(e, half, offset):
    """Return the share of a disc's width that lies under the ceiling, along one of its axes."""
    return min(max(0.5 + 0.5 * (half - abs(offset)) * e.inverse_radius, 0.0), 1.0)


@always_inline
def power_ratio(e, distance):
    """Return gamma, the induced power without a ceiling over that with one, at a distance in radii and equal thrust."""
    z = max(distance, LOWEST)
    fade = min(max((z - FADE_FROM) * (1.0 / (FADE_TO - FADE_FROM)), 0.0), 1.0)
    left = 1.0 - fade * fade * (3.0 - 2.0 * fade)
    return 1.0 + left * (0.5 * math.sqrt(1.0 + e.asymmetry / (8.0 * z * z)) - 0.5)


@noinline
def _rotor_factors(c, plan, z):
    """Return the factors on the thrust and the torque of a rotor."""
    e, s = c
    R, (px, py, pz) = s.R_world_body, s.motion.position_world
    x, y = plan
    below = e.height - (pz + R[6] * x + R[7] * y + R[8] * z)
    if below <= 0.0:
        return 1.0, 1.0
    share = _inside(e, e.half_size[0], px + R[0] * x + R[1] * y + R[2] * z - e.centre[0])
    share *= _inside(e, e.half_size[1], py + R[3] * x + R[4] * y + R[5] * z - e.centre[1])
    gamma = 1.0 + share * (power_ratio(e, e.inverse_radius * below) - 1.0)
    # t (q - 1) + sqrt(t) / gamma = q: the blades' thrust and the flow of that thrust
    slope = e.pitch - 1.0
    root = (math.sqrt(1.0 / (gamma * gamma) + 4.0 * e.pitch * slope) - 1.0 / gamma) / (2.0 * slope)
    return root * root, 1.0 + e.induced * (root * root * root / gamma - 1.0)


@load_factors(CeilingEffect)
def ceiling_effect(e, memory, s, before):
    """Multiply the thrust and torque factors."""
    change = map_tuple(_rotor_factors, (e, s), map_tuple(pair, 0.0, s.layout.x_body, s.layout.y_body), s.layout.z_body)
    thrust, torque = map_tuple(first, 0.0, change, change), map_tuple(second, 0.0, change, change)
    return Factors(map_tuple(product, 0.0, before.thrust, thrust), map_tuple(product, 0.0, before.torque, torque))


@is_sleeping(CeilingEffect)
def low(e, motion, h):
    """Return True if no rotor can reach the ceiling effect within a step."""
    return e.height - motion.position_world[2] - 2.0 * h * norm(motion.velocity_world) > e.reach
