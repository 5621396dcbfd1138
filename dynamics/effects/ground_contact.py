"""Contact of the feet with the ground: a stiff spring and damper along the normal, friction across it."""

import math

from dynamics.effects._contact_parameters import (
    FREE,
    SLIDING,
    STABLE,
    STABLE_REAL,
    STICKING,
    SUDDEN,
    GroundContact,
    GroundContactSmooth,
)
from dynamics.effects._feet import above, foot_on, stance_of
from dynamics.effects._ground import clearance, surface
from dynamics.effects._hooks import asleep, contact, settle, substeps, wrench
from dynamics.generate import each, implements
from dynamics.kernel import kernel, leaf
from dynamics.lie.quaternion import rotation_matrix
from dynamics.vector import ZERO, add, apply, apply_transposed, cross, dot, norm, scale, subtract


@leaf
def _far(e, motion, h):
    """Can no foot reach the ground within a step, whatever happens in it?"""
    velocity = motion.velocity_world
    approach = max(-clearance(e.ground, velocity), 0.0)
    return clearance(e.ground, motion.position_world) > e.reach + h * (2.0 * approach + h * SUDDEN)


@leaf
def _spring(e, anchor, foot):
    """Pull of the anchor on a foot, tangential [N]; none before the foot has touched."""
    k = 0.0 if anchor[2] == FREE else e.tangential_stiffness
    dx, dy = k * (anchor[0] - foot.x), k * (anchor[1] - foot.y)
    return (dx, dy, foot.rise[0] * dx + foot.rise[1] * dy)


@leaf
def _trial(e, anchor, foot):
    """(force if the foot sticks, maximum friction) [N]."""
    limit = (e.static if anchor[2] == STICKING else e.dynamic) * foot.press
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


@asleep(GroundContact)
def far(e, memory, motion, h):
    """Well above the ground?"""
    return _far(e, motion, h)


@asleep(GroundContactSmooth)
def far_smooth(e, memory, motion, h):
    """Well above the ground?"""
    return _far(e, motion, h)


@kernel
def _settled_foot(c, foot_body, anchor):
    e, stance = c
    if above(stance, foot_body):
        return (0.0, 0.0, FREE, 0.0)
    foot = foot_on(e, stance, foot_body)
    if foot.press <= 0.0:
        return (0.0, 0.0, FREE, 0.0)
    square = dot(foot.slip, foot.slip)
    if anchor[2] == FREE:
        anchor = (foot.x, foot.y, SLIDING, square)
    trial, limit = _trial(e, anchor, foot)
    if dot(trial, trial) <= limit * limit:
        return (anchor[0], anchor[1], STICKING, square)
    # a foot that is slowing down is held by the static coefficient, one that breaks away by the dynamic one
    caught = square < min(e.square_stick_velocity, anchor[3])
    limit = (e.static if caught else e.dynamic) * foot.press
    pull = norm(_spring(e, anchor, foot))
    kept = limit / pull if pull > limit else 1.0
    x, y = foot.x + kept * (anchor[0] - foot.x), foot.y + kept * (anchor[1] - foot.y)
    return (x, y, STICKING if caught else SLIDING, square)


@settle(GroundContact)
def drag_anchors(e, memory, motion, h):
    """Anchors after a step: kept by feet that stick, dragged along by feet that slide."""
    return each(_settled_foot, (e, stance_of(e, motion, rotation_matrix(motion.attitude))), e.feet, memory)


@substeps(GroundContact)
def split(e, memory, motion, h):
    """As many as the stiffest mode needs; default stiffness and 1 ms need no split."""
    return math.ceil(h * e.rate_bound / STABLE)


@substeps(GroundContactSmooth)
def split_smooth(e, memory, motion, h):
    """As many as the friction needs under the maximum normal force that the next step can bring."""
    R_world_body = rotation_matrix(motion.attitude)
    press = 0.0
    for i in range(len(e.feet)):
        arm = apply(R_world_body, e.feet[i])
        position = add(motion.position_world, arm)
        height, _, _ = surface(e.ground, position[0], position[1])
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
