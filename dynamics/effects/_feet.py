"""Where each foot is, how fast it slips and how hard it presses."""

from typing import NamedTuple

from dynamics.effects._ground import surface
from dynamics.kernel import leaf
from dynamics.vector import ZERO, Mat3, Vec3, add, apply, apply_transposed, cross, dot, scale


class Stance(NamedTuple):
    """What the feet have in common."""

    over_plane: float  # [m] of the centre of mass, less the height of the bumps
    normal_body: Vec3  # of the plane
    position_world: Vec3
    velocity_world: Vec3
    omega_world: Vec3
    R_world_body: Mat3


@leaf
def stance_of(e, motion, R_world_body):
    """Computed once for all feet."""
    normal, omega_world = e.ground.normal, apply(R_world_body, motion.omega_body)
    return Stance(
        dot(normal, motion.position_world) - e.ground.bump_height,
        apply_transposed(R_world_body, normal),
        motion.position_world,
        motion.velocity_world,
        omega_world,
        R_world_body,
    )


@leaf
def above(stance, foot_body):
    """Is a foot surely in the air? The cheap question that spares most of them the rest."""
    return stance.over_plane + dot(stance.normal_body, foot_body) >= 0.0


class Footing(NamedTuple):
    """One foot on the ground or above it, in world coordinates."""

    arm: Vec3  # [m] from the centre of mass
    x: float  # [m]
    y: float  # [m]
    press: float  # [N] normal force, 0 in the air
    slip: Vec3  # [m/s] tangential velocity
    normal: Vec3
    rise: tuple[float, float]  # of the ground along x and y


@leaf
def foot_on(e, stance, foot_body):
    """The footing of a foot (theory.md, eq. (2.12))."""
    arm = apply(stance.R_world_body, foot_body)
    x, y = stance.position_world[0] + arm[0], stance.position_world[1] + arm[1]
    height, rise, normal = surface(e.ground, x, y)
    depth = (height - (stance.position_world[2] + arm[2])) * normal[2]
    if depth <= 0.0:
        return Footing(arm, x, y, 0.0, ZERO, normal, rise)
    velocity = add(stance.velocity_world, cross(stance.omega_world, arm))
    approach = -dot(velocity, normal)
    onset = min(depth * e.inverse_width, 1.0)
    press = max(onset * onset * (3.0 - 2.0 * onset) * (e.stiffness * depth + e.damping * approach), 0.0)
    return Footing(arm, x, y, press, add(velocity, scale(approach, normal)), normal, rise)
