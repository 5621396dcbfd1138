"""Where each foot is, how fast it slips and how hard it presses."""

from typing import NamedTuple

from dynamics.kernel import leaf
from dynamics.terrain import over_plane, summit, touch, upright
from dynamics.vector import ZERO, Mat3, Vec3, add, apply, apply_transposed, cross, dot, scale


class Stance(NamedTuple):
    """What the feet have in common."""

    over: float  # [m] of the centre of mass over the slope, less what stands on it
    upright_body: Vec3  # whose product with a foot's place is its height over the slope
    position_world: Vec3
    velocity_world: Vec3
    omega_world: Vec3
    R_world_body: Mat3


@leaf
def stance_of(e, motion, R_world_body):
    """Computed once for all feet."""
    omega_world = apply(R_world_body, motion.omega_body)
    return Stance(
        over_plane(e.terrain, motion.position_world) - summit(e.terrain),
        apply_transposed(R_world_body, upright(e.terrain)),
        motion.position_world,
        motion.velocity_world,
        omega_world,
        R_world_body,
    )


@leaf
def above(stance, foot_body):
    """Is a foot surely in the air? The cheap question that spares most of them the rest."""
    return stance.over + dot(stance.upright_body, foot_body) >= 0.0


class Footing(NamedTuple):
    """One foot on the ground or above it, in world coordinates."""

    arm: Vec3  # [m] from the centre of mass
    place: Vec3  # [m]
    press: float  # [N] normal force, 0 in the air
    slip: Vec3  # [m/s] tangential velocity
    normal: Vec3
    depth: float  # [m] along the normal, 0 in the air
    approach: float  # [m/s] at which it grows, 0 in the air


@leaf
def foot_on(e, stance, foot_body):
    """The footing of a foot (theory.md, eq. (2.12))."""
    arm = apply(stance.R_world_body, foot_body)
    place = add(stance.position_world, arm)
    depth, normal = touch(e.terrain, place)
    if depth <= 0.0:
        return Footing(arm, place, 0.0, ZERO, normal, 0.0, 0.0)
    velocity = add(stance.velocity_world, cross(stance.omega_world, arm))
    approach = -dot(velocity, normal)
    onset = min(depth * e.inverse_width, 1.0)
    press = max(onset * onset * (3.0 - 2.0 * onset) * (e.stiffness * depth + e.damping * approach), 0.0)
    return Footing(arm, place, press, add(velocity, scale(approach, normal)), normal, depth, approach)
