"""Three controllers for the cooperative load: load tracking, link directions, attitudes (Lee, Sreenath, Kumar 2013).

Pure: (p, t, x) -> LiftCommand, for the control service and the closed loop alike (theory, eqs. (7.22) to (7.27)).
"""

import math
from typing import NamedTuple

from lapwing.dynamics.lie.quaternion import rotation_matrix
from lapwing.dynamics.lie.so3 import vee
from lapwing.dynamics.vector import (
    Vec3,
    add,
    apply_transposed,
    cross,
    dot,
    matmul,
    multiply,
    norm,
    scale,
    subtract,
    transpose,
)
from lapwing.kernels import always_inline, kernel
from lapwing.kernels.codegen import map_index
from lapwing.papers.cooperative_load import cooperative_load as formation
from lapwing.papers.cooperative_load.cooperative_load import (
    COMMANDS,
    LiftCommand,
    add_outer,
    link_acceleration,
    load_acceleration,
    solve_symmetric,
)

UPRIGHT_SHARE = 0.3  # smallest vertical force of the desired attitude, relative to a quadrotor's weight
NOTHING = (0.0, 0.0, 0.0)
FORWARD = (1.0, 0.0, 0.0)  # heading of all quadrotors
SHARE_DAMPING = 0.03  # keeps the shares bounded if the links do not span space (theory, eq. (7.23))


@always_inline
def desired_load(path, t):
    """Return (position, velocity, acceleration) of the desired path at time t."""
    velocity = add(path[1], scale(2.0 * t, path[2]))
    return add(path[0], add(scale(t, path[1]), scale(t * t, path[2]))), velocity, scale(2.0, path[2])


@always_inline
def desired_specific_force(p, t, x, acceleration):
    """Return the desired v' - a_g of the load [m/s^2] and its derivative, at its actual acceleration (eq. (7.22))."""
    c = p.control
    position, velocity, desired_acceleration = desired_load(c.path, t)
    e_y, e_v = subtract(x.load_position, position), subtract(x.load_velocity, velocity)
    feedback = add(scale(-c.load_position_gain, e_y), scale(-c.load_velocity_gain, e_v))
    change = subtract(desired_acceleration, acceleration)
    slope = add(scale(-c.load_position_gain, e_v), scale(c.load_velocity_gain, change))
    return add(add(feedback, desired_acceleration), (0.0, 0.0, p.gravity)), slope


@always_inline
def _solve_damped(matrix, x, b, b_rate):
    """Return the solution of (sum of q q^T + damping) s = b and its derivative."""
    s = solve_symmetric(matrix, b)
    for i in range(len(x.link)):
        q = x.link[i].direction
        q_rate = cross(x.link[i].omega, q)
        b_rate = subtract(b_rate, add(scale(dot(q, s), q_rate), scale(dot(q_rate, s), q)))
    return s, solve_symmetric(matrix, b_rate)


@kernel
def shares(p, x, desired, slope):
    """Return the vector s whose parts along the links carry F_d together, and its derivative (eq. (7.23))."""
    matrix = (SHARE_DAMPING, 0.0, 0.0, 0.0, SHARE_DAMPING, 0.0, 0.0, 0.0, SHARE_DAMPING)
    for i in range(len(x.link)):
        matrix = add_outer(matrix, 1.0, x.link[i].direction)
    s, s_rate = _solve_damped(matrix, x, scale(p.load_mass, desired), scale(p.load_mass, slope))
    # second pass on the residual of the damping, whose effect becomes of second order
    rest, rest_rate = _solve_damped(matrix, x, scale(SHARE_DAMPING, s), scale(SHARE_DAMPING, s_rate))
    return add(s, rest), add(s_rate, rest_rate)


@kernel
def desired_force(p, x, desired, slope, s, s_rate, omega_rate, i):
    """Return the desired world force [N] of quadrotor i, and its derivative (theory, eqs. (7.24) and (7.25))."""
    c = p.control
    q, omega = x.link[i].direction, x.link[i].omega
    m, inertia = p.quad_mass[i], p.quad_mass[i] * p.link_length[i]
    parallel = dot(q, s) + inertia * dot(omega, omega) + m * dot(q, desired)
    swing = add(scale(-c.link_direction_gain, cross(c.direction[i], q)), scale(-c.link_rate_gain, omega))
    # the part normal to the link gives the desired link rotation: omega' = q x (v' - a_g) / L - q x u / (m L)
    lever = subtract(scale(m, cross(q, desired)), scale(inertia, swing))
    force = add(scale(parallel, q), cross(lever, q))
    # derivative of the same terms
    q_rate = cross(omega, q)
    parallel_rate = dot(q_rate, s) + dot(q, s_rate) + 2.0 * inertia * dot(omega, omega_rate)
    parallel_rate += m * (dot(q_rate, desired) + dot(q, slope))
    swing_rate = add(scale(-c.link_direction_gain, cross(c.direction[i], q_rate)), scale(-c.link_rate_gain, omega_rate))
    lever_rate = subtract(scale(m, add(cross(q_rate, desired), cross(q, slope))), scale(inertia, swing_rate))
    along = add(scale(parallel_rate, q), scale(parallel, q_rate))
    return force, add(along, add(cross(lever_rate, q), cross(lever, q_rate)))


@always_inline
def _unit(a, a_rate):
    """Return a / |a| and its derivative."""
    k = 1.0 / norm(a)
    unit = scale(k, a)
    return unit, scale(k, subtract(a_rate, scale(dot(unit, a_rate), unit)))


@always_inline
def upright(force, force_rate, floor):
    """Return the force with a vertical part smoothly limited to above `floor` [N], and its derivative.

    The limit keeps quadrotors from tipping over.
    """
    over = force[2] - floor
    root = math.sqrt(over * over + 0.04 * floor * floor)
    slope = 0.5 * (1.0 + over / root)
    limited = (force[0], force[1], floor + 0.5 * (over + root))
    return limited, (force_rate[0], force_rate[1], slope * force_rate[2])


@always_inline
def desired_attitude(force, force_rate):
    """Return R_world_desired, with z along the force and x towards world x, and its rate in that frame (eq. (7.26))."""
    z, z_rate = _unit(force, force_rate)
    y, y_rate = _unit(cross(z, FORWARD), cross(z_rate, FORWARD))
    x, x_rate = cross(y, z), add(cross(y_rate, z), cross(y, z_rate))
    matrix = (x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2])
    return matrix, (dot(z, y_rate), dot(x, z_rate), dot(y, x_rate))


@kernel
def moment(p, x, force, force_rate, i):
    """Return the moment [N m] that aligns body z with the desired force (theory, eq. (7.27))."""
    c = p.control
    limited, kept_rate = upright(force, force_rate, UPRIGHT_SHARE * p.quad_mass[i] * p.gravity)
    desired, desired_omega = desired_attitude(limited, kept_rate)
    difference = matmul(transpose(desired), rotation_matrix(x.attitude[i]))
    o = x.omega_body[i]
    rate_error = subtract(o, apply_transposed(difference, desired_omega))
    damped = scale(-c.attitude_rate_gain / c.epsilon, rate_error)
    turned = scale(-c.attitude_gain / (c.epsilon * c.epsilon), vee(difference))
    return add(add(turned, damped), cross(o, multiply(p.quad_inertia[i], o)))


@always_inline
def quad_thrust(p, x, desired, slope, s, s_rate, i):
    """Return the thrust [N] of quadrotor i: the part of its desired force along its axis."""
    # forces do not depend on the accelerations, their derivatives do
    force, _ = desired_force(p, x, desired, slope, s, s_rate, NOTHING, i)
    m = rotation_matrix(x.attitude[i])
    return dot(force, (m[2], m[5], m[8]))


@always_inline
def quad_moment(p, x, desired, slope, s, s_rate, force, specific, i):
    """Return the moment [N m] of quadrotor i for all forces [N] and the specific acceleration [m/s^2]."""
    omega_rate = link_acceleration(p, x, force, specific, i)
    force_i, force_i_rate = desired_force(p, x, desired, slope, s, s_rate, omega_rate, i)
    return moment(p, x, force_i, force_i_rate, i)


class FormationControl(NamedTuple):
    """Gains, the load's desired path and the links' desired directions (one for each quadrotor, fixed)."""

    load_position_gain: float  # [1/s^2]
    load_velocity_gain: float  # [1/s]
    link_direction_gain: float  # [1/s^2]
    link_rate_gain: float  # [1/s]
    attitude_gain: float  # [N m], before the scaling by epsilon^2
    attitude_rate_gain: float  # [N m s], before the scaling by epsilon
    epsilon: float
    path: tuple[Vec3, Vec3, Vec3]  # [m] desired load position is path[0] + path[1] t + path[2] t^2
    direction: tuple[Vec3, ...]  # desired unit link directions, quadrotor to load


@kernel
def formation_control(p, t, x):
    """Return thrusts and moments of all quadrotors at time t (theory, eqs. (7.22) to (7.27))."""
    desired, slope = desired_specific_force(p, t, x, (0.0, 0.0, 0.0))
    s, s_rate = shares(p, x, desired, slope)
    thrust = map_index(quad_thrust, x.link, p, x, desired, slope, s, s_rate)
    # the thrusts give the accelerations, and these the rates of the desired forces
    force = map_index(formation.thrust_world, x.link, x, thrust)
    specific = load_acceleration(p, x, force)
    desired, slope = desired_specific_force(p, t, x, add(specific, (0.0, 0.0, -p.gravity)))
    s, s_rate = shares(p, x, desired, slope)
    return LiftCommand(thrust, map_index(quad_moment, x.link, p, x, desired, slope, s, s_rate, force, specific))


COMMANDS[FormationControl] = formation_control
