"""Shadow and reflections of satellite signals at obstacles of the terrain (theory, eqs. (3.57) to (3.59))."""

from typing import Annotated, Any, NamedTuple

from annotated_types import Ge, Gt, Le, Lt
from numba import types

from lapwing.dynamics.terrain import Level
from lapwing.dynamics.terrain.ray_casting import cast
from lapwing.dynamics.vector import Vec3
from lapwing.kernels import always_inline, kernel, math
from lapwing.kernels.codegen import generic

SPEED_OF_LIGHT = 299_792_458.0  # [m/s]
WAVELENGTH = SPEED_OF_LIGHT / 1575.42e6  # [m] of L1 and E1
CHIP = SPEED_OF_LIGHT / 1.023e6  # [m] of the C/A code
FARTHEST = 1000.0  # [m] maximum distance of obstacles


class Reflections(NamedTuple):
    """Multipath: each wall of a box reflects like a mirror."""

    amplitude: Annotated[float, Gt(0), Lt(1)] = 0.5  # of the reflected signal over the direct one
    spacing: Annotated[float, Gt(0), Le(CHIP)] = 0.1 * CHIP  # [m] between early and late correlator
    phase_deg: Annotated[float, Ge(-360), Le(360)] = 180.0  # [deg] phase shift of the carrier at a wall


@always_inline
def _never(terrain: Any, position: Vec3, towards: Vec3, steepness: float) -> bool:
    return False


@always_inline
def _behind_relief(terrain: Any, position: Vec3, towards: Vec3, steepness: float) -> bool:
    return cast(terrain, position, towards, steepness, FARTHEST) < math.inf


@generic(inline=True)
def in_shadow(terrain: types.Type, position: types.Type, towards: types.Type, steepness: types.Type) -> Any:
    """Return True if an obstacle or the ground is between a position and a satellite."""
    return _never if terrain.instance_class is Level else _behind_relief


@kernel
def detour(box: Any, position: Vec3, towards: Vec3, across: bool) -> float:
    """Return the additional path [m] of a signal by a wall of a box; 0 without a reflection (theory, eq. (3.57)).

    Args:
        box: row of `Relief.boxes`.
        position: [m] of the antenna.
        towards: unit vector to the satellite.
        across: True for the walls across the box's width, False for those at the ends of its length.
    """
    x, y, c, s = position[0] - box[0], position[1] - box[1], box[2], box[3]
    place, other = c * x + s * y, c * y - s * x
    speed, aside = c * towards[0] + s * towards[1], c * towards[1] - s * towards[0]
    low, high, first, last = box[4], box[5], -box[6], box[6]
    if across:
        place, other, speed, aside = other, place, aside, speed
        low, high, first, last = first, last, low, high
    distance = place - high
    if speed < 0.0:
        distance, speed = low - place, -speed
    if distance <= 0.0 or speed <= 0.0:
        return 0.0
    way = distance / speed
    if not first <= other + way * aside <= last or position[2] + way * towards[2] > box[7]:
        return 0.0
    return 2.0 * distance * speed


@kernel
def code_delay(r: Reflections, detour_length: float) -> float:
    """Return the error [m] of a code measurement by a reflection with this detour [m] (theory, eq. (3.58))."""
    q = r.amplitude * math.cos(2.0 * math.pi * detour_length / WAVELENGTH + math.radians(r.phase_deg))
    half = 0.5 * r.spacing
    if detour_length < (1.0 + q) * half:
        return detour_length * q / (1.0 + q)
    if detour_length < CHIP - (1.0 - q) * half:
        return q * half
    if detour_length < CHIP + half:
        return q * (CHIP + half - detour_length) / (2.0 - q)
    return 0.0


@kernel
def phase_delay(r: Reflections, detour_length: float) -> float:
    """Return the error [m] of a carrier phase by a reflection with this detour [m] (theory, eq. (3.59))."""
    if detour_length > CHIP:
        return 0.0
    sine, cosine = math.sincos(2.0 * math.pi * detour_length / WAVELENGTH + math.radians(r.phase_deg))
    return WAVELENGTH / (2.0 * math.pi) * math.atan2(r.amplitude * sine, 1.0 + r.amplitude * cosine)


@always_inline
def _no_walls(r: Reflections, terrain: Any, position: Vec3, towards: Vec3) -> float:
    return 0.0


@kernel
def _code_at_walls(r: Reflections, terrain: Any, position: Vec3, towards: Vec3) -> float:
    result = 0.0
    for i in range(terrain.boxes.shape[0]):
        for across in (False, True):
            detour_length = detour(terrain.boxes[i], position, towards, across)
            if detour_length > 0.0:
                result += code_delay(r, detour_length)
    return result


@kernel
def _phase_at_walls(r: Reflections, terrain: Any, position: Vec3, towards: Vec3) -> float:
    result = 0.0
    for i in range(terrain.boxes.shape[0]):
        for across in (False, True):
            detour_length = detour(terrain.boxes[i], position, towards, across)
            if detour_length > 0.0:
                result += phase_delay(r, detour_length)
    return result


@generic(inline=True)
def code_error(r: types.Type, terrain: types.Type, position: types.Type, towards: types.Type) -> Any:
    """Return the error [m] of a code measurement by all walls."""
    return _no_walls if terrain.instance_class is Level else _code_at_walls


@generic(inline=True)
def phase_error(r: types.Type, terrain: types.Type, position: types.Type, towards: types.Type) -> Any:
    """Return the error [m] of a carrier phase by all walls."""
    return _no_walls if terrain.instance_class is Level else _phase_at_walls
