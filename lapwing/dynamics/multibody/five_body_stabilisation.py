"""Stabilisation of the five bodies on the fast path: projection, coordinate partitioning, and constraint defect."""

from lapwing.dynamics.integrators import step
from lapwing.dynamics.lie import quaternion
from lapwing.dynamics.multibody.arrowhead_solver import Core, HingedBody, eliminate, reflected_inertia
from lapwing.dynamics.multibody.five_bodies import UP, BodyState, FiveBodies, column, free_turn, from_chassis
from lapwing.dynamics.vector import ZERO, add, apply, apply_transposed, cross, dot, multiply, norm, scale, subtract
from lapwing.kernels import always_inline, kernel, math
from lapwing.kernels.simd import deinterleave, interleave, select, select_vector, sqrt

NONE, PARTITION, PROJECTION = 0, 1, 2


@always_inline
def _gap(chassis, R0, offset, x):
    """Return the displacement of a leaf from its hinge [m] and its spin axis, in chassis axes."""
    away = subtract(x.position_world, chassis.position_world)
    axis = column(quaternion.rotation_matrix(x.attitude), 2)
    return subtract(apply_transposed(R0, away), offset), apply_transposed(R0, axis)


@always_inline
def _idle_leaves(r, spins, C, drift, turn, force, torque):
    """Return leaves with idle drives, with momenta in place of loads, or without loads."""
    mass, moments, rest = r.held * r.mass, scale(r.held, r.inertia), 0.0 * r.mass
    return HingedBody(
        mass,
        reflected_inertia(C, moments, spins),
        r.offset,
        column(C, 2),
        r.inertia[2],
        spins,
        rest,
        drift,
        turn,
        force,
        torque,
    )


@always_inline
def _rotate(q, turn):
    """Return the attitude after a rotation in the body [rad], of third order and unit length, without a root."""
    s = scale(0.25, turn)
    square = dot(s, s)
    k = 1.0 / (1.0 + square)
    x, y, z = scale(2.0 * k, s)
    t = quaternion.multiply(q, quaternion.Quaternion(k - k * square, x, y, z))
    k = 1.5 - 0.5 * ((t[0] * t[0] + t[1] * t[1]) + (t[2] * t[2] + t[3] * t[3]))
    return quaternion.Quaternion(k * t[0], k * t[1], k * t[2], k * t[3])


@always_inline
def _attitude(flag, a, b):
    """Return the attitude a where flag is above zero, else b."""
    return quaternion.Quaternion(
        select(flag, a[0], b[0]), select(flag, a[1], b[1]), select(flag, a[2], b[2]), select(flag, a[3], b[3])
    )


@always_inline
def _closed_lanes(p, c, r, b):
    """Return (chassis, propellers) as SIMD lanes with closed hinges."""
    R0, C = quaternion.rotation_matrix(c.attitude), from_chassis(c, b)
    axis = column(C, 2)
    gap = subtract(apply_transposed(R0, subtract(b.position_world, c.position_world)), r.offset)
    # rows v1 . v3 and v2 . v3 are axis[0], axis[1]; their increments must be the opposite
    turn = free_turn(axis, -axis[0], -axis[1])
    none, all_spin = scale(0.0, gap), 1.0 + 0.0 * r.mass
    s = eliminate(_core(p, ZERO, ZERO), _idle_leaves(r, all_spin, C, scale(-1.0, gap), turn, none, none))
    moved = apply(R0, s.acceleration)
    position = add(b.position_world, add(moved, apply(R0, s.relative)))
    attitude = _rotate(b.attitude, apply_transposed(C, s.turned))
    turned = _rotate(c.attitude, s.angular_acceleration)
    return (
        BodyState(add(c.position_world, moved), turned, c.velocity_world, c.omega_body),
        BodyState(
            select_vector(r.held, position, b.position_world),
            _attitude(r.held, attitude, b.attitude),
            b.velocity_world,
            b.omega_body,
        ),
    )


@always_inline
def _core(p, force, torque):
    return Core(p.mass, (p.inertia[0], p.inertia[1], p.inertia[2], 0.0, 0.0, 0.0), force, torque)


@always_inline
def project(p, t, x):
    """Project to the nearest consistent state in the metric of the masses (theory, eqs. (8.31), (8.32)).

    One Newton step on position level, then the velocities: a drift of e leaves e^2.
    """
    r = interleave(p.rotors)
    c, b = _closed_lanes(p, x.chassis, r, interleave(x.propellers))
    R0, C = quaternion.rotation_matrix(c.attitude), from_chassis(c, b)
    speed = r.speed + r.drive * t
    still = 0.0 * speed
    momentum = apply_transposed(R0, scale(r.held * r.mass, b.velocity_world))
    angular = apply(C, multiply(scale(r.held, r.inertia), b.omega_body))
    imposed = select_vector(r.spins, (still, still, still), (still, still, speed))
    core = _core(p, scale(p.mass, apply_transposed(R0, c.velocity_world)), multiply(p.inertia, c.omega_body))
    s = eliminate(core, _idle_leaves(r, r.spins, C, (still, still, still), imposed, momentum, angular))
    velocity = apply(R0, s.acceleration)
    return FiveBodies(
        BodyState(c.position_world, c.attitude, velocity, s.angular_acceleration),
        deinterleave(
            BodyState(
                b.position_world,
                b.attitude,
                select_vector(r.held, add(velocity, apply(R0, s.relative)), b.velocity_world),
                select_vector(r.held, apply_transposed(C, s.turned), b.omega_body),
            )
        ),
    )


@always_inline
def partition(p, t, x):
    """Compute all dependent coordinates from chassis pose, spin angles and their rates (theory, eq. (8.33))."""
    c = x.chassis
    c = BodyState(c.position_world, quaternion.normalise(c.attitude), c.velocity_world, c.omega_body)
    R0, r, b = quaternion.rotation_matrix(c.attitude), interleave(p.rotors), interleave(x.propellers)
    relative = quaternion.multiply(quaternion.conjugate(c.attitude), b.attitude)
    axis = column(quaternion.rotation_matrix(relative), 2)
    # the shortest rotation of a leaf's axis to the chassis' z, about axis x z
    swing = quaternion.Quaternion(1.0 + axis[2], axis[1], -axis[0], 0.0 * axis[0])
    relative = _unit(quaternion.multiply(swing, relative))
    core_rate = quaternion.rotate_back(relative, c.omega_body)
    spin = select(r.spins, b.omega_body[2] - core_rate[2], r.speed + r.drive * t)
    followed = BodyState(
        add(c.position_world, apply(R0, r.offset)),
        quaternion.multiply(c.attitude, relative),
        add(c.velocity_world, apply(R0, cross(c.omega_body, r.offset))),
        (core_rate[0], core_rate[1], core_rate[2] + spin),
    )
    return FiveBodies(
        c,
        deinterleave(
            BodyState(
                select_vector(r.held, followed.position_world, b.position_world),
                _attitude(r.held, followed.attitude, b.attitude),
                select_vector(r.held, followed.velocity_world, b.velocity_world),
                select_vector(r.held, followed.omega_body, b.omega_body),
            )
        ),
    )


@always_inline
def _unit(q):
    """Normalise quaternions in SIMD lanes."""
    k = 1.0 / sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return quaternion.Quaternion(k * q[0], k * q[1], k * q[2], k * q[3])


@always_inline
def _worse(a, b):
    """Return the larger of two, NaN if the second is."""
    return a if b <= a else b


@kernel
def constraint_violation(p, x):
    """Return the largest defect of any hinge: (position [m] or axis [-], velocity [m/s] or [rad/s])."""
    R0 = quaternion.rotation_matrix(x.chassis.attitude)
    w = x.chassis.omega_body
    position, velocity = 0.0, 0.0
    for k in range(4):
        r, b = p.rotors[k], x.propellers[k]
        if r.held > 0.0:
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
    """Take n steps of h with `method`, a token of `lapwing.dynamics.integrators`, and NONE, PARTITION or PROJECTION."""
    for i in range(n):
        x = step(method, p, t + i * h, x, h)
        if stabilisation == PROJECTION:
            x = project(p, t + (i + 1) * h, x)
        elif stabilisation == PARTITION:
            x = partition(p, t + (i + 1) * h, x)
    return x


@kernel
def assembled_state(p, chassis, angles, speeds):
    """Return the consistent state of a chassis and four spin angles [rad] and speeds [rad/s] relative to it."""
    R0 = quaternion.rotation_matrix(chassis.attitude)
    r = p.rotors
    return FiveBodies(
        chassis,
        (
            _place_propeller(r[0], R0, chassis, angles[0], speeds[0]),
            _place_propeller(r[1], R0, chassis, angles[1], speeds[1]),
            _place_propeller(r[2], R0, chassis, angles[2], speeds[2]),
            _place_propeller(r[3], R0, chassis, angles[3], speeds[3]),
        ),
    )


@always_inline
def _place_propeller(r, R0, chassis, angle, speed):
    half = quaternion.Quaternion(math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle))
    position = add(chassis.position_world, apply(R0, r.offset))
    velocity = add(chassis.velocity_world, apply(R0, cross(chassis.omega_body, r.offset)))
    omega = quaternion.rotate_back(half, add(chassis.omega_body, scale(speed, UP)))
    return BodyState(position, quaternion.multiply(chassis.attitude, half), velocity, omega)
