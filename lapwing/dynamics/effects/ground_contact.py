"""Contact of the feet with the ground: a stiff spring and damper along the normal, friction across it."""

import math

from lapwing.dynamics.effects._contact_parameters import (
    FREE,
    NOWHERE,
    SLIDING,
    STABLE,
    STABLE_REAL,
    STICKING,
    SUDDEN,
    GroundContact,
    GroundContactSmooth,
)
from lapwing.dynamics.effects._foot_contact import NO_FOOT, footing, in_reach, stance_of
from lapwing.dynamics.effects._hooks import asleep, contact, contact_forces, event, settle, substeps, wrench
from lapwing.dynamics.lie.quaternion import rotation_matrix
from lapwing.dynamics.terrain import over_plane, summit, surface
from lapwing.dynamics.vector import ZERO, add, apply, apply_transposed, cross, dot, scale, subtract
from lapwing.kernels import kernel, leaf
from lapwing.kernels.codegen import any_of, each, fold, implements
from lapwing.kernels.simd import any_above, beside, choose, root, separate, where
from lapwing.kernels.simd_chunks import in_fours, one_by_one

WALL = 0.5  # z of the normal of a face, below which it is a wall


@leaf
def _far(e, motion, h):
    """Can no foot reach the ground within a step, whatever happens in it?"""
    velocity = motion.velocity_world
    approach = max(-over_plane(e.terrain, velocity), 0.0)
    over = over_plane(e.terrain, motion.position_world) - summit(e.terrain)
    return over > e.reach + h * (2.0 * approach + h * SUDDEN)


@leaf
def _spring(e, anchor, foot):
    """Pull of the anchors on four feet, tangential [N]; none before a foot has touched."""
    k = where(anchor[3], e.tangential_stiffness, 0.0)
    pull, n = scale(k, subtract(anchor, foot.place)), foot.normal
    # brought into the plane along z: by its normal, feet on a slope would step on at 1 ms
    along_z = (pull[0], pull[1], -(n[0] * pull[0] + n[1] * pull[1]) / n[2])
    return choose(n[2] - WALL, along_z, subtract(pull, scale(dot(n, pull), n)))


@leaf
def _trial(e, anchor, foot):
    """(force if the feet stick, maximum friction) [N]."""
    sliding = anchor[3] - STICKING
    limit = where(sliding, e.dynamic, where(anchor[3], e.static, e.dynamic)) * foot.press
    return subtract(_spring(e, anchor, foot), scale(e.damping, foot.slip)), limit


def _friction(e, memory, foot):
    raise NotImplementedError("compiled code only")


@implements(_friction, inline=True)
def _friction_by_law(e, memory, foot):
    if e.instance_class is GroundContact:

        def anchored(e, memory, foot):
            trial, limit = _trial(e, memory, foot)
            square = dot(trial, trial)
            over = square - limit * limit
            return choose(over, scale(limit / root(square), trial), trial) if any_above(over) else trial

        return anchored

    def smooth(e, memory, foot):
        speed = root(dot(foot.slip, foot.slip))
        x = speed * e.inverse_critical
        below = -foot.press * e.static * e.inverse_critical * (1.5 - 0.5 * x * x)
        y = 2.0 * (x - 1.0)
        y = where(1.0 - y, y, 1.0)
        coefficient = e.static + (e.dynamic - e.static) * y * y * (3.0 - 2.0 * y)
        return scale(where(1.0 - x, below, -coefficient * foot.press / speed), foot.slip)

    return smooth


@leaf
def _push(e, stance, feet_body, memory):
    """(force, torque) of four feet, in world coordinates, in lanes; zero where a foot is in the air."""
    foot = footing(e, stance, feet_body)
    force = add(scale(foot.press, foot.normal), _friction(e, memory, foot))
    pressing = where(in_reach(stance, feet_body), foot.press, 0.0)
    return choose(pressing, force, ZERO), choose(pressing, cross(foot.arm, force), ZERO)


@leaf
def _in_turn(start, four):
    """`start` plus the four lanes' vectors, added in the order of the feet."""
    a, b, c, d = separate(four)
    return add(add(add(add(start, a), b), c), d)


@leaf
def _pushed(c, before, feet, memory):
    e, stance = c
    feet_body = beside(feet)
    if not any_above(in_reach(stance, feet_body)):
        return before
    force, torque = _push(e, stance, feet_body, beside(memory))
    return _in_turn(before[0], force), _in_turn(before[1], torque)


@kernel
def _feet_wrench(e, memory, motion, R_world_body):
    stance = stance_of(e, motion, R_world_body)
    feet, memory = in_fours(e.feet, NO_FOOT), in_fours(memory, memory[0])
    force, torque_world = fold(_pushed, (e, stance), (ZERO, ZERO), feet, memory)
    return force, apply_transposed(R_world_body, torque_world)


@wrench(GroundContact)
def ground_contact(e, memory, s, rotors):
    """Force [N] in world, torque [N m] in body coordinates."""
    return _feet_wrench(e, memory, s.motion, s.R_world_body)


@wrench(GroundContactSmooth)
def ground_contact_smooth(e, memory, s, rotors):
    """Force [N] in world, torque [N m] in body coordinates."""
    return _feet_wrench(e, memory, s.motion, s.R_world_body)


@leaf
def _on_points(c, feet, memory):
    e, stance = c
    feet_body = beside(feet)
    place = add(stance.position_world, apply(stance.R_world_body, feet_body))
    return separate((place, _push(e, stance, feet_body, beside(memory))[0]))


@leaf
def _forces(e, memory, motion):
    stance = stance_of(e, motion, rotation_matrix(motion.attitude))
    feet, fours = in_fours(e.feet, NO_FOOT), in_fours(memory, memory[0])
    return one_by_one(each(_on_points, (e, stance), feet, fours), e.feet)


@contact_forces(GroundContact)
def forces(e, memory, motion):
    """((place [m], force [N]) of every foot and point of the hull), world."""
    return _forces(e, memory, motion)


@contact_forces(GroundContactSmooth)
def forces_smooth(e, memory, motion):
    """((place [m], force [N]) of every foot and point of the hull), world."""
    return _forces(e, memory, motion)


@asleep(GroundContact)
def far(e, memory, motion, h):
    """Well above the ground?"""
    return _far(e, motion, h)


@asleep(GroundContactSmooth)
def far_smooth(e, memory, motion, h):
    """Well above the ground?"""
    return _far(e, motion, h)


@leaf
def _settled_four(c, feet, memory):
    e, stance, h = c
    feet_body = beside(feet)
    reached = in_reach(stance, feet_body)
    if not any_above(reached):
        return (NOWHERE, NOWHERE, NOWHERE, NOWHERE)
    foot = footing(e, stance, feet_body)
    pressing = where(reached, foot.press, 0.0)
    x, y, z, how, before = beside(memory)
    square = dot(foot.slip, foot.slip)
    since = foot.depth / foot.approach
    since = where(foot.approach, where(h - since, since, h), h)  # [s] a foot has touched
    place = choose(how, (x, y, z), subtract(foot.place, scale(since, foot.slip)))
    how, before = where(how, how, SLIDING), where(how, before, square)
    anchor = (place[0], place[1], place[2], how)
    trial, limit = _trial(e, anchor, foot)
    over = where(pressing, dot(trial, trial) - limit * limit, 0.0)
    how = where(over, how, STICKING)
    if any_above(over):
        # a foot that is slowing down is held by the static coefficient, one that breaks away by the dynamic one
        caught = where(before - e.square_stick_velocity, e.square_stick_velocity, before) - square
        spring = _spring(e, anchor, foot)
        pull, limit = root(dot(spring, spring)), where(caught, e.static, e.dynamic) * foot.press
        kept = where(pull - limit, limit / pull, 1.0)
        place = choose(over, add(foot.place, scale(kept, subtract(place, foot.place))), place)
        how = where(over, where(caught, STICKING, SLIDING), how)
    # how high an anchor is counts on a wall only, and would else disturb the error control
    place = (place[0], place[1], where(foot.normal[2] - WALL, 0.0, place[2]))
    place = choose(pressing, place, ZERO)
    return separate((*place, where(pressing, how, FREE), where(pressing, square, 0.0)))


@settle(GroundContact)
def drag_anchors(e, memory, motion, h):
    """Anchors after a step: kept by feet that stick, dragged along by feet that slide."""
    stance = stance_of(e, motion, rotation_matrix(motion.attitude))
    feet, fours = in_fours(e.feet, NO_FOOT), in_fours(memory, memory[0])
    return one_by_one(each(_settled_four, (e, stance, h), feet, fours), memory)


@leaf
def _lets_go(_, before, after):
    return before[3] + after[3] == STICKING + SLIDING


@event(GroundContact)
def lets_go(e, before, after):
    """Has any foot begun to slide, or to stick?"""
    return any_of(each(_lets_go, 0.0, before, after))


@substeps(GroundContact)
def split(e, memory, motion, h):
    """As many as the stiffest mode needs to be stable; default stiffness and 1 ms need no split."""
    return math.ceil(h * e.rate_bound / STABLE)


@substeps(GroundContactSmooth)
def split_smooth(e, memory, motion, h):
    """As many as the friction needs under the maximum normal force that the next step can bring."""
    R_world_body = rotation_matrix(motion.attitude)
    press = 0.0
    for i in range(len(e.feet)):
        arm = apply(R_world_body, e.feet[i])
        position = add(motion.position_world, arm)
        height, _ = surface(e.terrain, position[0], position[1])
        velocity = add(motion.velocity_world, apply(R_world_body, cross(motion.omega_body, e.feet[i])))
        approach = max(-velocity[2], 0.0)
        press += max(e.stiffness * (height - position[2] + h * approach) + e.damping * approach, 0.0)
    friction = 1.5 * e.static * e.inverse_critical * e.mobility * press  # [1/s] steepest part of the law
    return max(math.ceil(h * e.rate_bound / STABLE), math.ceil(h * friction / STABLE_REAL))


@leaf
def _press(c, touching, feet, _):
    e, stance = c
    return touching or any_above(footing(e, stance, beside(feet)).press)


@kernel
def _touches(e, motion, R_world_body):
    feet = in_fours(e.feet, NO_FOOT)
    return fold(_press, (e, stance_of(e, motion, R_world_body)), False, feet, feet)


@contact(GroundContact)
def touches(e, memory, s):
    """Does any foot press on the ground?"""
    return _touches(e, s.motion, s.R_world_body)


@contact(GroundContactSmooth)
def touches_smooth(e, memory, s):
    """Does any foot press on the ground?"""
    return _touches(e, s.motion, s.R_world_body)
