"""Contact of the feet with the ground: a stiff spring and damper along the normal, friction across it."""

import math

from lapwing.dynamics.effects._contact_parameters import STABLE, STABLE_REAL, SUDDEN, GroundContact, GroundContactSmooth
from lapwing.dynamics.effects._foot_contact import NO_FOOT, contact_of_feet, in_reach, stance_of
from lapwing.dynamics.effects._hooks import (
    can_sleep,
    contact,
    contact_forces,
    is_sleeping,
    substeps,
    wrench,
    wrench_and_rate,
)
from lapwing.dynamics.lie.quaternion import rotation_matrix
from lapwing.dynamics.terrain import over_plane, summit, surface
from lapwing.dynamics.vector import ZERO, add, apply, apply_transposed, cross, dot, scale, subtract
from lapwing.kernels import always_inline, kernel
from lapwing.kernels.codegen import generic, map_tuple, reduce_tuple
from lapwing.kernels.simd import any_above, chunk4, deinterleave, interleave, select, select_vector, sqrt, unchunk4
from lapwing.kernels.state_tree import largest

RELAXED = 1e-13  # [m] deflection of friction elements that counts as zero


@is_sleeping(GroundContact, GroundContactSmooth)
def far(e, motion, h):
    """Return True if no foot can reach the ground within a step."""
    velocity = motion.velocity_world
    approach = max(-over_plane(e.terrain, velocity), 0.0)
    over = over_plane(e.terrain, motion.position_world) - summit(e.terrain)
    return over > e.reach + h * (2.0 * approach + h * SUDDEN)


@always_inline
def _element(e, deflection, foot):
    """Return (friction force [N], rate of the deflection [m/s]) of four feet (theory, eq. (2.13), (2.14))."""
    k, n = e.tangential_stiffness, foot.normal
    pull, slip = scale(k, deflection), foot.slip
    stretched = add(subtract(pull, scale(dot(pull, n), n)), scale(e.tangential_damping, slip))
    y = sqrt(dot(slip, slip)) * e.inverse_stiction
    y = select(1.0 - y, y, 1.0)
    limit = (e.static + (e.dynamic - e.static) * y * y * (3.0 - 2.0 * y)) * foot.load
    square = dot(stretched, stretched)
    over = square - limit * limit
    limited = select_vector(over, scale(limit / sqrt(square), stretched), stretched) if any_above(over) else stretched
    return scale(-1.0, limited), scale(1.0 / e.tangential_damping, subtract(limited, pull))


@generic(inline=True)
def _friction(e, memory, foot):
    if e.instance_class is GroundContact:
        return lambda e, memory, foot: _element(e, memory, foot)[0]

    def smooth(e, memory, foot):
        speed = sqrt(dot(foot.slip, foot.slip))
        x = speed * e.inverse_critical
        below = -foot.load * e.static * e.inverse_critical * (1.5 - 0.5 * x * x)
        y = 2.0 * (x - 1.0)
        y = select(1.0 - y, y, 1.0)
        coefficient = e.static + (e.dynamic - e.static) * y * y * (3.0 - 2.0 * y)
        return scale(select(1.0 - x, below, -coefficient * foot.load / speed), foot.slip)

    return smooth


@always_inline
def _push(e, stance, feet_body, memory):
    """Return (force, torque) of four feet in world coordinates, in lanes; zero where a foot is in the air."""
    foot = contact_of_feet(e, stance, feet_body)
    force = add(scale(foot.press, foot.normal), _friction(e, memory, foot))
    pressing = select(in_reach(stance, feet_body), foot.press, 0.0)
    return select_vector(pressing, force, ZERO), select_vector(pressing, cross(foot.arm, force), ZERO)


@always_inline
def _in_turn(start, four):
    """Return `start` plus the vectors of the four lanes, added in the order of the feet."""
    a, b, c, d = deinterleave(four)
    return add(add(add(add(start, a), b), c), d)


@always_inline
def _add_push(c, before, feet, memory):
    e, stance = c
    feet_body = interleave(feet)
    if not any_above(in_reach(stance, feet_body)):
        return before
    force, torque = _push(e, stance, feet_body, interleave(memory))
    return _in_turn(before[0], force), _in_turn(before[1], torque)


@kernel
def _feet_wrench(e, memory, motion, R_world_body):
    stance = stance_of(e, motion, R_world_body)
    feet, memory = chunk4(e.feet, NO_FOOT), chunk4(memory, memory[0])
    force, torque_world = reduce_tuple(_add_push, (e, stance), (ZERO, ZERO), feet, memory)
    return force, apply_transposed(R_world_body, torque_world)


@wrench(GroundContact, GroundContactSmooth)
def ground_contact(e, memory, s, rotors):
    """Return the force [N] in world, torque [N m] in body coordinates."""
    return _feet_wrench(e, memory, s.motion, s.R_world_body)


@always_inline
def _on_points(c, feet, memory):
    e, stance = c
    feet_body = interleave(feet)
    place = add(stance.position_world, apply(stance.R_world_body, feet_body))
    return deinterleave((place, _push(e, stance, feet_body, interleave(memory))[0]))


@contact_forces(GroundContact, GroundContactSmooth)
def forces(e, memory, motion):
    """Return ((place [m], force [N]) of every foot and point of the hull), world."""
    stance = stance_of(e, motion, rotation_matrix(motion.attitude))
    feet, fours = chunk4(e.feet, NO_FOOT), chunk4(memory, memory[0])
    return unchunk4(map_tuple(_on_points, (e, stance), feet, fours), e.feet)


@can_sleep(GroundContact)
def relaxed(e, memory):
    """Return True if the friction elements have relaxed."""
    return largest(memory) < RELAXED


@always_inline
def _load_four_feet(c, feet, memory):
    """Return (reach, force, torque, rates of the elements) of four feet; all but the rates in lanes."""
    e, stance = c
    feet_body, deflection = interleave(feet), interleave(memory)
    relaxing = scale(-e.tangential_stiffness / e.tangential_damping, deflection)
    reached = in_reach(stance, feet_body)
    if not any_above(reached):
        return reached, feet_body, feet_body, deinterleave(relaxing)  # no loads: `_add_four_feet` skips them
    foot = contact_of_feet(e, stance, feet_body)
    friction, rate = _element(e, deflection, foot)
    force = add(scale(foot.press, foot.normal), friction)
    pressing = select(reached, foot.press, 0.0)
    push, turn = select_vector(pressing, force, ZERO), select_vector(pressing, cross(foot.arm, force), ZERO)
    return reached, push, turn, deinterleave(select_vector(pressing, rate, relaxing))


@always_inline
def _add_four_feet(_, before, four, __):
    reached, force, torque, _ = four
    if not any_above(reached):
        return before
    return _in_turn(before[0], force), _in_turn(before[1], torque)


@always_inline
def _rates_of(_, four, __):
    return four[3]


@wrench_and_rate(GroundContact)
def loads_and_stretching(e, memory, motion):
    """Return the wrench of `ground_contact` and the deflection rates [m/s] of the elements, which relax in the air."""
    R_world_body = rotation_matrix(motion.attitude)
    stance = stance_of(e, motion, R_world_body)
    feet, deflections = chunk4(e.feet, NO_FOOT), chunk4(memory, memory[0])
    fours = map_tuple(_load_four_feet, (e, stance), feet, deflections)
    force, torque_world = reduce_tuple(_add_four_feet, 0.0, (ZERO, ZERO), fours, fours)
    rates = unchunk4(map_tuple(_rates_of, 0.0, fours, fours), memory)
    return force, apply_transposed(R_world_body, torque_world), rates


@substeps(GroundContact)
def split(e, memory, motion, h):
    """Return the substeps for stability of the stiffest mode; default stiffness and 1 ms need no split."""
    return math.ceil(h * e.rate_bound / STABLE)


@substeps(GroundContactSmooth)
def split_smooth(e, memory, motion, h):
    """Return the substeps for the friction at the maximum normal force of the next step."""
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


@always_inline
def _press(c, touching, feet, _):
    e, stance = c
    return touching or any_above(contact_of_feet(e, stance, interleave(feet)).press)


@kernel
def _touches(e, motion, R_world_body):
    feet = chunk4(e.feet, NO_FOOT)
    return reduce_tuple(_press, (e, stance_of(e, motion, R_world_body)), False, feet, feet)


@contact(GroundContact, GroundContactSmooth)
def touches(e, memory, s):
    """Return True if any foot presses on the ground."""
    return _touches(e, s.motion, s.R_world_body)
