"""Contact of the feet with the ground: a stiff spring and damper along the normal, friction across it."""

import math

from dynamics.effects._contact_parameters import (
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
from dynamics.effects._feet import above, foot_on, stance_of
from dynamics.effects._hooks import asleep, contact, contact_forces, event, settle, substeps, wrench
from dynamics.generate import any_of, each, implements
from dynamics.kernel import kernel, leaf
from dynamics.lie.quaternion import rotation_matrix
from dynamics.terrain import over_plane, summit, surface
from dynamics.vector import ZERO, add, apply, apply_transposed, cross, dot, norm, scale, subtract

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
    """Pull of the anchor on a foot, tangential [N]; none before the foot has touched."""
    k = 0.0 if anchor[3] == FREE else e.tangential_stiffness
    x, y, z = foot.place
    dx, dy, n = k * (anchor[0] - x), k * (anchor[1] - y), foot.normal
    if n[2] > WALL:  # brought into the plane along z: by its normal, feet on a slope would step on at 1 ms
        return (dx, dy, -(n[0] * dx + n[1] * dy) / n[2])
    pull = (dx, dy, k * (anchor[2] - z))
    return subtract(pull, scale(dot(n, pull), n))


@leaf
def _trial(e, anchor, foot):
    """(force if the foot sticks, maximum friction) [N]."""
    limit = (e.static if anchor[3] == STICKING else e.dynamic) * foot.press
    return subtract(_spring(e, anchor, foot), scale(e.damping, foot.slip)), limit


def _friction(e, memory, foot):
    raise NotImplementedError("compiled code only")


@implements(_friction, inline=True)
def _friction_by_law(e, memory, foot):
    if e.instance_class is GroundContact:

        def anchored(e, memory, foot):
            trial, limit = _trial(e, memory, foot)
            square = dot(trial, trial)
            return scale(limit / math.sqrt(square), trial) if square > limit * limit else trial

        return anchored

    def smooth(e, memory, foot):
        speed = norm(foot.slip)
        x = speed * e.inverse_critical
        if x < 1.0:
            return scale(-foot.press * e.static * e.inverse_critical * (1.5 - 0.5 * x * x), foot.slip)
        y = min(2.0 * (x - 1.0), 1.0)
        coefficient = e.static + (e.dynamic - e.static) * y * y * (3.0 - 2.0 * y)
        return scale(-coefficient * foot.press / speed, foot.slip)

    return smooth


@leaf
def _push(e, stance, foot_body, memory):
    """(force, torque) of one foot, in world coordinates."""
    if above(stance, foot_body):
        return ZERO, ZERO
    foot = foot_on(e, stance, foot_body)
    if foot.press <= 0.0:
        return ZERO, ZERO
    force = add(scale(foot.press, foot.normal), _friction(e, memory, foot))
    return force, cross(foot.arm, force)


@kernel
def _feet_wrench(e, memory, motion, R_world_body):
    # a loop and a call, not written out foot by foot: a fifth of the time to compile
    stance = stance_of(e, motion, R_world_body)
    force, torque_world = ZERO, ZERO
    for i in range(len(e.feet)):
        push = _push(e, stance, e.feet[i], memory[i])
        force, torque_world = add(force, push[0]), add(torque_world, push[1])
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
def _on_point(c, foot_body, memory):
    e, stance = c
    place = add(stance.position_world, apply(stance.R_world_body, foot_body))
    return place, _push(e, stance, foot_body, memory)[0]


@contact_forces(GroundContact)
def forces(e, memory, motion):
    """((place [m], force [N]) of every foot and point of the hull), world."""
    return each(_on_point, (e, stance_of(e, motion, rotation_matrix(motion.attitude))), e.feet, memory)


@contact_forces(GroundContactSmooth)
def forces_smooth(e, memory, motion):
    """((place [m], force [N]) of every foot and point of the hull), world."""
    return each(_on_point, (e, stance_of(e, motion, rotation_matrix(motion.attitude))), e.feet, memory)


@asleep(GroundContact)
def far(e, memory, motion, h):
    """Well above the ground?"""
    return _far(e, motion, h)


@asleep(GroundContactSmooth)
def far_smooth(e, memory, motion, h):
    """Well above the ground?"""
    return _far(e, motion, h)


@leaf
def _anchored(foot, anchor, how, square):
    """A foot's memory; how high its anchor is counts on a wall only, and would else disturb the error control."""
    return (anchor[0], anchor[1], anchor[2] if foot.normal[2] <= WALL else 0.0, how, square)


@kernel
def _settled_foot(c, foot_body, anchor):
    e, stance, h = c
    if above(stance, foot_body):
        return NOWHERE
    foot = foot_on(e, stance, foot_body)
    if foot.press <= 0.0:
        return NOWHERE
    square = dot(foot.slip, foot.slip)
    if anchor[3] == FREE:
        since = min(h, foot.depth / foot.approach) if foot.approach > 0.0 else h  # [s] it has touched
        start = subtract(foot.place, scale(since, foot.slip))
        anchor = (start[0], start[1], start[2], SLIDING, square)
    trial, limit = _trial(e, anchor, foot)
    if dot(trial, trial) <= limit * limit:
        return _anchored(foot, anchor, STICKING, square)
    # a foot that is slowing down is held by the static coefficient, one that breaks away by the dynamic one
    caught = square < min(e.square_stick_velocity, anchor[4])
    limit = (e.static if caught else e.dynamic) * foot.press
    pull = norm(_spring(e, anchor, foot))
    kept = limit / pull if pull > limit else 1.0
    dragged = add(foot.place, scale(kept, subtract(anchor, foot.place)))
    return _anchored(foot, dragged, STICKING if caught else SLIDING, square)


@settle(GroundContact)
def drag_anchors(e, memory, motion, h):
    """Anchors after a step: kept by feet that stick, dragged along by feet that slide."""
    return each(_settled_foot, (e, stance_of(e, motion, rotation_matrix(motion.attitude)), h), e.feet, memory)


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


@kernel
def _touches(e, motion, R_world_body):
    stance = stance_of(e, motion, R_world_body)
    touching = False
    for i in range(len(e.feet)):
        touching = touching or foot_on(e, stance, e.feet[i]).press > 0.0
    return touching


@contact(GroundContact)
def touches(e, memory, s):
    """Does any foot press on the ground?"""
    return _touches(e, s.motion, s.R_world_body)


@contact(GroundContactSmooth)
def touches_smooth(e, memory, s):
    """Does any foot press on the ground?"""
    return _touches(e, s.motion, s.R_world_body)
