"""Keeping the five bodies together on the fast path: projection, coordinate partitioning, and the constraint defect."""

import math

from dynamics.integrators import step
from dynamics.kernel import kernel, leaf
from dynamics.lie import quaternion
from dynamics.multibody.arrow import Core, Leaf, eliminate, felt, rotated
from dynamics.multibody.five_bodies import UP, BodyState, FiveBodies, column, free_turn
from dynamics.vector import (
    ZERO,
    add,
    apply,
    apply_transposed,
    cross,
    matmul,
    multiply,
    norm,
    scale,
    subtract,
    transpose,
)

NONE, PARTITION, PROJECTION = 0, 1, 2


@leaf
def _gap(chassis, R0, offset, x):
    """Where the leaf is missing from its hinge [m] and its spin axis, in chassis axes."""
    away = subtract(x.position_world, chassis.position_world)
    axis = column(quaternion.rotation_matrix(x.attitude), 2)
    return subtract(apply_transposed(R0, away), offset), apply_transposed(R0, axis)


@leaf
def _position_leaf(r, chassis, R0, x):
    R = quaternion.rotation_matrix(x.attitude)
    offset = apply(R0, r.offset)
    gap = subtract(subtract(x.position_world, chassis.position_world), offset)
    axis = column(R, 2)
    a = apply_transposed(R0, axis)
    # rows v1 . v3 and v2 . v3 are a[0], a[1]; their increments must be the opposite
    turn = free_turn(R0, a, -a[0], -a[1])
    inertia = felt(R, r.inertia, 1.0)
    return Leaf(r.mass, inertia, offset, axis, r.inertia[2], 1.0, 0.0, scale(-1.0, gap), turn, ZERO, ZERO)


@leaf
def _velocity_leaf(r, t, R0, x):
    R = quaternion.rotation_matrix(x.attitude)
    axis = column(R, 2)
    turn = ZERO if r.spins > 0.0 else scale(r.speed + r.drive * t, column(R0, 2))
    momentum = scale(r.mass, x.velocity_world)
    angular = apply(R, multiply(r.inertia, x.omega_body))
    inertia, offset = felt(R, r.inertia, r.spins), apply(R0, r.offset)
    return Leaf(r.mass, inertia, offset, axis, r.inertia[2], r.spins, 0.0, ZERO, turn, momentum, angular)


@leaf
def _displaced(x, displacement, turn):
    own = apply_transposed(quaternion.rotation_matrix(x.attitude), turn)
    attitude = quaternion.normalise(quaternion.retract(x.attitude, own))
    return BodyState(add(x.position_world, displacement), attitude, x.velocity_world, x.omega_body)


@leaf
def _redirected(x, velocity, omega):
    own = apply_transposed(quaternion.rotation_matrix(x.attitude), omega)
    return BodyState(x.position_world, x.attitude, velocity, own)


@leaf
def _applied(change, x, s):
    """`change` of all five bodies by an `arrow.Result` that holds displacements or velocities, not accelerations."""
    b, l1, l2, l3, l4 = x.propellers, s.leaves[0], s.leaves[1], s.leaves[2], s.leaves[3]
    return FiveBodies(
        change(x.chassis, s.acceleration, s.angular_acceleration),
        (
            change(b[0], l1.acceleration, l1.angular_acceleration),
            change(b[1], l2.acceleration, l2.angular_acceleration),
            change(b[2], l3.acceleration, l3.angular_acceleration),
            change(b[3], l4.acceleration, l4.angular_acceleration),
        ),
    )


@kernel
def project(p, t, x):
    """The nearest state, in the metric of the masses, that meets all constraints (theory.md, eqs. (8.31), (8.32)).

    One Newton step on position level, then the velocities: a drift of e is left at e^2.
    """
    r, b, c = p.rotors, x.propellers, x.chassis
    R0 = quaternion.rotation_matrix(c.attitude)
    leaves = (
        _position_leaf(r[0], c, R0, b[0]),
        _position_leaf(r[1], c, R0, b[1]),
        _position_leaf(r[2], c, R0, b[2]),
        _position_leaf(r[3], c, R0, b[3]),
    )
    x = _applied(_displaced, x, eliminate(Core(p.mass, rotated(R0, p.inertia), ZERO, ZERO), leaves))
    b, c = x.propellers, x.chassis
    R0 = quaternion.rotation_matrix(c.attitude)
    leaves = (
        _velocity_leaf(r[0], t, R0, b[0]),
        _velocity_leaf(r[1], t, R0, b[1]),
        _velocity_leaf(r[2], t, R0, b[2]),
        _velocity_leaf(r[3], t, R0, b[3]),
    )
    angular = apply(R0, multiply(p.inertia, c.omega_body))
    core = Core(p.mass, rotated(R0, p.inertia), scale(p.mass, c.velocity_world), angular)
    return _applied(_redirected, x, eliminate(core, leaves))


@leaf
def _follow(r, t, R0, chassis, x):
    """The leaf put back on the chassis; its spin angle and spin speed are kept."""
    C = matmul(transpose(R0), quaternion.rotation_matrix(x.attitude))
    axis = column(C, 2)
    # the shortest turn that takes the leaf's axis onto the chassis' z: about axis x z
    swing = quaternion.normalise(quaternion.Quaternion(1.0 + axis[2], axis[1], -axis[0], 0.0))
    relative = quaternion.multiply(swing, quaternion.from_matrix(C))
    attitude = quaternion.normalise(quaternion.multiply(chassis.attitude, relative))
    position = add(chassis.position_world, apply(R0, r.offset))
    velocity = add(chassis.velocity_world, apply(R0, cross(chassis.omega_body, r.offset)))
    core_rate = quaternion.rotate_back(relative, chassis.omega_body)
    spin = x.omega_body[2] - core_rate[2] if r.spins > 0.0 else r.speed + r.drive * t
    return BodyState(position, attitude, velocity, (core_rate[0], core_rate[1], core_rate[2] + spin))


@kernel
def partition(p, t, x):
    """Chassis pose, spin angles and their rates are independent; all else follows (theory.md, eq. (8.33))."""
    q = quaternion.normalise(x.chassis.attitude)
    chassis = BodyState(x.chassis.position_world, q, x.chassis.velocity_world, x.chassis.omega_body)
    R0 = quaternion.rotation_matrix(q)
    r, b = p.rotors, x.propellers
    return FiveBodies(
        chassis,
        (
            _follow(r[0], t, R0, chassis, b[0]),
            _follow(r[1], t, R0, chassis, b[1]),
            _follow(r[2], t, R0, chassis, b[2]),
            _follow(r[3], t, R0, chassis, b[3]),
        ),
    )


@leaf
def _worse(a, b):
    """The larger of two, NaN if the second is."""
    return a if b <= a else b


@kernel
def violation(p, x):
    """Largest defect of any hinge: (position [m] or axis [-], velocity [m/s] or [rad/s])."""
    R0 = quaternion.rotation_matrix(x.chassis.attitude)
    w = x.chassis.omega_body
    position, velocity = 0.0, 0.0
    for k in range(4):
        r, b = p.rotors[k], x.propellers[k]
        if r.mass > 0.0:
            gap, axis = _gap(x.chassis, R0, r.offset, b)
            position = _worse(_worse(position, norm(gap)), math.hypot(axis[0], axis[1]))
            slip = subtract(
                apply_transposed(R0, subtract(b.velocity_world, x.chassis.velocity_world)), cross(w, r.offset)
            )
            own = apply(quaternion.rotation_matrix(b.attitude), b.omega_body)
            wobble = subtract(apply_transposed(R0, own), w)
            velocity = _worse(_worse(velocity, norm(slip)), math.hypot(wobble[0], wobble[1]))
    return position, velocity


@kernel
def advance(method, p, t, x, h, n, stabilisation):
    """n steps of h with `method` (a token of `dynamics.integrators`), held by NONE, PARTITION or PROJECTION."""
    for i in range(n):
        x = step(method, p, t + i * h, x, h)
        if stabilisation == PROJECTION:
            x = project(p, t + (i + 1) * h, x)
        elif stabilisation == PARTITION:
            x = partition(p, t + (i + 1) * h, x)
    return x


@kernel
def together(p, chassis, angles, speeds):
    """Consistent state of a chassis and four spin angles [rad] and speeds [rad/s], relative to the chassis."""
    R0 = quaternion.rotation_matrix(chassis.attitude)
    r = p.rotors
    return FiveBodies(
        chassis,
        (
            _placed(r[0], R0, chassis, angles[0], speeds[0]),
            _placed(r[1], R0, chassis, angles[1], speeds[1]),
            _placed(r[2], R0, chassis, angles[2], speeds[2]),
            _placed(r[3], R0, chassis, angles[3], speeds[3]),
        ),
    )


@leaf
def _placed(r, R0, chassis, angle, speed):
    half = quaternion.Quaternion(math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle))
    position = add(chassis.position_world, apply(R0, r.offset))
    velocity = add(chassis.velocity_world, apply(R0, cross(chassis.omega_body, r.offset)))
    omega = quaternion.rotate_back(half, add(chassis.omega_body, scale(speed, UP)))
    return BodyState(position, quaternion.multiply(chassis.attitude, half), velocity, omega)
