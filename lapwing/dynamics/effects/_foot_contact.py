"""Position, slip and normal force of each foot; four feet in SIMD lanes (lapwing/kernels/simd.py)."""

import math
from typing import NamedTuple

from lapwing.dynamics.terrain import Level, over_plane, summit, touch, upright
from lapwing.dynamics.vector import Mat3, Vec3, add, apply, apply_transposed, cross, dot, scale
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import generic, map_tuple
from lapwing.kernels.simd import deinterleave, interleave, select, splat

NO_FOOT = (math.nan, math.nan, math.nan)  # completes a group of four; it never touches the ground


class Stance(NamedTuple):
    """State shared by all feet."""

    over: float  # [m] height of the centre of mass over the slope, less the highest obstacle
    upright_body: Vec3  # its product with a foot's position is the height over the slope
    position_world: Vec3
    velocity_world: Vec3
    omega_world: Vec3
    R_world_body: Mat3


@always_inline
def stance_of(e, motion, R_world_body):
    """Compute the state shared by all feet."""
    omega_world = apply(R_world_body, motion.omega_body)
    return Stance(
        over_plane(e.terrain, motion.position_world) - summit(e.terrain),
        apply_transposed(R_world_body, upright(e.terrain)),
        motion.position_world,
        motion.velocity_world,
        omega_world,
        R_world_body,
    )


@always_inline
def in_reach(stance, feet_body):
    """Return a positive number for feet that may touch: a cheap test that skips most of them."""
    return -(stance.over + dot(stance.upright_body, feet_body))


class FootContact(NamedTuple):
    """Four feet on the ground or above it, in world coordinates; every number in four lanes."""

    arm: Vec3  # [m] from the centre of mass
    place: Vec3  # [m]
    press: float  # [N] normal force, 0 in the air
    load: float  # [N] sum of the normal forces of all faces, which limits friction: more than `press` in inner corners
    slip: Vec3  # [m/s] tangential velocity, of no meaning in the air
    normal: Vec3
    depth: float  # [m] along the normal, not positive in the air
    approach: float  # [m/s] its rate


@always_inline
def _touch(terrain, place_world, _):
    return touch(terrain, place_world)


@generic(inline=True)
def _touch_four(terrain, places_world):
    """Evaluate `touch` at four positions in SIMD lanes."""
    if terrain.instance_class is Level:

        def level(terrain, places_world):
            depth, normal, wedge = touch(terrain, places_world)
            return depth, (splat(normal[0]), splat(normal[1]), splat(normal[2])), splat(wedge)

        return level

    def one_by_one(terrain, places_world):
        places = deinterleave(places_world)
        return interleave(map_tuple(_touch, terrain, places, places))

    return one_by_one


@always_inline
def contact_of_feet(e, stance, feet_body):
    """Return the contact of four feet (theory, eq. (2.12))."""
    arm = apply(stance.R_world_body, feet_body)
    place = add(stance.position_world, arm)
    depth, normal, wedge = _touch_four(e.terrain, place)
    velocity = add(stance.velocity_world, cross(stance.omega_world, arm))
    approach = -dot(velocity, normal)
    onset = depth * e.inverse_width
    onset = select(1.0 - onset, onset, 1.0)
    press = onset * onset * (3.0 - 2.0 * onset) * (e.stiffness * depth + e.damping * approach)
    press = select(depth, select(press, press, 0.0), 0.0)
    slip = add(velocity, scale(approach, normal))
    return FootContact(arm, place, press, wedge * press, slip, normal, depth, approach)
