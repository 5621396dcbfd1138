"""Five bodies of the delivery drone, each with its own pose, on the fast path: redundant coordinates on SE(3).

State trees for `lapwing.dynamics.integrators`. Constraints are enforced by the accelerations (index 1) and drift as in
the general engine, unless `five_body_stabilisation` corrects them after a step. A hinge fixes a leaf's centre of mass
at a chassis point; both its axes are z.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lapwing.dynamics.integrators import RATES
from lapwing.dynamics.lie import quaternion
from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.multibody.arrowhead_solver import Core, HingedBody, eliminate, reflected_inertia
from lapwing.dynamics.multibody.delivery_drone import Drone
from lapwing.dynamics.vector import (
    ZERO,
    Vec3,
    add,
    apply,
    apply_transposed,
    cross,
    divide,
    dot,
    multiply,
    scale,
    subtract,
)
from lapwing.kernels import always_inline
from lapwing.kernels.simd import deinterleave, interleave, select_vector

UP: Vec3 = (0.0, 0.0, 1.0)


class BodyState(NamedTuple):
    """State of one body: its centre of mass and its attitude."""

    position_world: Vec3  # [m]
    attitude: Quaternion
    velocity_world: Vec3  # [m/s]
    omega_body: Vec3  # [rad/s]


class FiveBodies(NamedTuple):
    """The chassis and its four propellers."""

    chassis: BodyState
    propellers: tuple[BodyState, BodyState, BodyState, BodyState]


class Wrench(NamedTuple):
    """External load on one body: force at the centre of mass [N] and torque [N m]."""

    force_world: Vec3
    torque_body: Vec3


NO_WRENCH = Wrench(ZERO, ZERO)


class Rotor(NamedTuple):
    """Propeller with its hinge and drive."""

    mass: float  # [kg]
    inertia: Vec3  # principal moments, z along the hinge [kg m^2]
    offset: Vec3  # hinge in chassis coordinates [m]
    spins: float  # 1: torque-driven (10 degrees of freedom), 0: imposed speed (6)
    drive: float  # torque from the chassis [N m] if it spins, else imposed acceleration [rad/s^2]
    speed: float  # imposed speed relative to the chassis at t = 0 [rad/s]; ignored if it spins
    wrench: Wrench
    held: float  # 1; 0: torn off, a free body


class Machine(NamedTuple):
    """All parameters and loads of the five bodies, constant over a step."""

    mass: float  # chassis [kg]
    inertia: Vec3  # chassis, principal moments [kg m^2]
    gravity: Vec3  # [m/s^2], world
    wrench: Wrench  # on the chassis
    rotors: tuple[Rotor, ...]
    feedback: float  # Baumgarte's rate of critically damped feedback [1/s], eq. (8.30); 0: none


@always_inline
def column(R, k):
    """Return column k of a 3x3 matrix: body axis k in the world."""
    return (R[k], R[3 + k], R[6 + k])


@always_inline
def from_chassis(chassis, leaf):
    """Return rotation matrices from the leaves' axes to the chassis' axes.

    They are orthogonal even if the attitudes in the stages of a step are not exactly of unit length.
    """
    q = quaternion.multiply(quaternion.conjugate(chassis.attitude), leaf.attitude)
    k = 2.0 / ((q[0] * q[0] + q[1] * q[1]) + (q[2] * q[2] + q[3] * q[3]))
    x2, y2, z2 = k * q[1], k * q[2], k * q[3]
    xx, yy, zz = q[1] * x2, q[2] * y2, q[3] * z2
    xy, xz, yz = q[1] * y2, q[1] * z2, q[2] * z2
    wx, wy, wz = q[0] * x2, q[0] * y2, q[0] * z2
    return (1.0 - (yy + zz), xy - wz, xz + wy, xy + wz, 1.0 - (xx + zz), yz - wx, xz - wy, yz + wx, 1.0 - (xx + yy))


@always_inline
def free_turn(axis, gamma_1, gamma_2):
    """Return the relative angular acceleration required by rows v1 . v3 and v2 . v3, up to the hinge axis (eq. (8.46)).

    v1 and v2 are the chassis' x and y axes, `axis` is v3.
    """
    k = 1.0 / axis[2]
    return (-k * gamma_2, k * gamma_1, 0.0 * k)


@always_inline
def _baumgarte_feedback(rate, r, speed, x, chassis, R0, axis, own):
    """Return (drift, turn) of Baumgarte's feedback at `rate` [1/s] of a hinge's defect (theory, eq. (8.30))."""
    w, back = chassis.omega_body, rate * rate
    gap = subtract(apply_transposed(R0, subtract(x.position_world, chassis.position_world)), r.offset)
    opening = subtract(apply_transposed(R0, subtract(x.velocity_world, chassis.velocity_world)), cross(w, r.offset))
    drift = add(scale(-2.0 * rate, opening), scale(-back, gap))
    relative = subtract(own, w)
    swing = cross(relative, axis)
    tilt = free_turn(axis, -back * axis[0], -back * axis[1])
    swings = free_turn(axis, -2.0 * rate * swing[0], -2.0 * rate * swing[1])
    slip = subtract(relative, (0.0, 0.0, speed))
    return drift, add(tilt, select_vector(r.spins, swings, scale(-2.0 * rate, slip)))


@always_inline
def _leaf(r, x, t, chassis, R0, C, gravity_body, feedback):
    """Return the solver's data of the rotors r in states x, in chassis axes; C: `from_chassis`."""
    w, own, axis = chassis.omega_body, apply(C, x.omega_body), column(C, 2)
    slip = subtract(w, own)
    square, wa = dot(slip, slip), dot(w, axis)
    twice = 2.0 * wa - x.omega_body[2]
    gamma_1 = axis[0] * square - w[0] * wa + own[0] * twice
    gamma_2 = axis[1] * square - w[1] * wa + own[1] * twice
    speed = r.speed + r.drive * t
    turn = select_vector(r.spins, free_turn(axis, gamma_1, gamma_2), (w[1] * speed, -w[0] * speed, r.drive))
    mass, moments = r.held * r.mass, scale(r.held, r.inertia)
    force = add(scale(mass, gravity_body), scale(r.held, apply_transposed(R0, r.wrench.force_world)))
    gyroscopic = cross(x.omega_body, multiply(moments, x.omega_body))
    torque = apply(C, subtract(scale(r.held, r.wrench.torque_body), gyroscopic))
    drift = subtract(scale(dot(w, r.offset), w), scale(dot(w, w), r.offset))
    if feedback > 0.0:
        more, swing = _baumgarte_feedback(feedback, r, speed, x, chassis, R0, axis, own)
        drift, turn = add(drift, more), add(turn, swing)
    inertia = reflected_inertia(C, moments, r.spins)
    drive = r.held * r.drive
    return HingedBody(mass, inertia, r.offset, axis, r.inertia[2], r.spins, drive, drift, turn, force, torque)


@always_inline
def solve(p, t, x):
    """Return (`arrowhead_solver.Result` at a state in chassis axes, chassis to world, leaves to chassis)."""
    c, r, b = x.chassis, interleave(p.rotors), interleave(x.propellers)
    R0, C, w = quaternion.rotation_matrix(c.attitude), from_chassis(c, b), c.omega_body
    g = apply_transposed(R0, p.gravity)
    core = Core(
        p.mass,
        (p.inertia[0], p.inertia[1], p.inertia[2], 0.0, 0.0, 0.0),
        add(scale(p.mass, g), apply_transposed(R0, p.wrench.force_world)),
        subtract(p.wrench.torque_body, cross(w, multiply(p.inertia, w))),
    )
    return eliminate(core, _leaf(r, b, t, c, R0, C, g, p.feedback)), R0, C


@always_inline
def rate(p, t, x):
    """Return the tangent of the state: index-1 equations of motion by elimination (theory, eqs. (8.40)-(8.46))."""
    s, R0, C = solve(p, t, x)
    r, b = interleave(p.rotors), interleave(x.propellers)
    acceleration = apply(R0, s.acceleration)
    # a torn-off propeller is a free body
    free = add(p.gravity, scale(1.0 / r.mass, r.wrench.force_world))
    spun = subtract(r.wrench.torque_body, cross(b.omega_body, multiply(r.inertia, b.omega_body)))
    turned = select_vector(r.held, apply_transposed(C, s.turned), divide(spun, r.inertia))
    moved = select_vector(r.held, add(acceleration, apply(R0, s.relative)), free)
    return FiveBodies(
        BodyState(x.chassis.velocity_world, x.chassis.omega_body, acceleration, s.angular_acceleration),
        deinterleave(BodyState(b.velocity_world, b.omega_body, moved, turned)),
    )


RATES[Machine] = rate


@always_inline
def reactions(p, t, x):
    """Return (force [N], torque about its hinge [N m]) from the chassis on each propeller, in the world."""
    s, R0, _ = solve(p, t, x)
    return deinterleave((apply(R0, s.reaction_force), apply(R0, s.reaction_torque)))


def machine(
    drone: Drone,
    gravity: Vec3,
    drive: Sequence[float] = (0.0, 0.0, 0.0, 0.0),
    speeds: Sequence[float] = (0.0, 0.0, 0.0, 0.0),
    wrenches: Sequence[Wrench] = (NO_WRENCH,) * 5,
) -> Machine:
    """Return the five bodies of a drone, without Baumgarte's feedback.

    Args:
        drone: mass properties.
        gravity: [m/s^2], world.
        drive: torque from the chassis [N m] of a spinning propeller, otherwise imposed acceleration [rad/s^2].
        speeds: imposed speeds relative to the chassis at t = 0 [rad/s].
        wrenches: external wrench on each body, chassis first.
    """
    rotors = tuple(
        Rotor(
            drone.propeller_mass[k], drone.propeller_inertia[k], drone.hubs[k], drone.spins[k],
            float(drive[k]), float(speeds[k]), wrenches[k + 1], drone.held[k],
        )
        for k in range(4)
    )  # fmt: skip
    return Machine(drone.mass, drone.inertia, gravity, wrenches[0], rotors, 0.0)


def arrays(x: FiveBodies) -> tuple[np.ndarray, np.ndarray]:
    """Return configuration (5, 7) and velocity (5, 6) for the general engine; also splits a tangent."""
    bodies = (x.chassis, *x.propellers)
    first = np.array([[*b.position_world, *b.attitude] for b in bodies])
    return first, np.array([[*b.velocity_world, *b.omega_body] for b in bodies])
