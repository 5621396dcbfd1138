"""The delivery drone's five bodies, each with its own pose, on the fast path: redundant coordinates on SE(3).

State trees for `dynamics.integrators`; constraints hold through the accelerations (index 1) and drift as they would in
the general engine, unless `hold` brings them back after a step. A hinge holds a leaf's centre of mass on a chassis
point; both its axes are z.
"""

from typing import NamedTuple

import numpy as np

from dynamics.integrators import RATES
from dynamics.kernel import kernel, leaf
from dynamics.lie import quaternion
from dynamics.lie.quaternion import Quaternion
from dynamics.multibody.arrow import Core, Leaf, eliminate, felt, rotated
from dynamics.vector import ZERO, Vec3, add, apply, apply_transposed, cross, dot, multiply, scale, subtract

UP: Vec3 = (0.0, 0.0, 1.0)


class BodyState(NamedTuple):
    """One body: state of its centre of mass and its attitude."""

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
    """A propeller, its hinge and its drive."""

    mass: float  # [kg]
    inertia: Vec3  # principal moments, z along the hinge [kg m^2]
    offset: Vec3  # hinge in chassis coordinates [m]
    spins: float  # 1: torque-driven (10 degrees of freedom), 0: imposed speed (6)
    drive: float  # torque from the chassis [N m] if it spins, else imposed acceleration [rad/s^2]
    speed: float  # imposed speed relative to the chassis at t = 0 [rad/s]; not read if it spins
    wrench: Wrench


class Machine(NamedTuple):
    """All parameters and loads of the five bodies, constant over a step."""

    mass: float  # chassis [kg]
    inertia: Vec3  # chassis, principal moments [kg m^2]
    gravity: Vec3  # [m/s^2], world
    wrench: Wrench  # on the chassis
    rotors: tuple[Rotor, ...]
    feedback: float  # Baumgarte's rate of critically damped feedback [1/s], eq. (8.30); 0: none


@leaf
def column(R, k):
    """Column k of a 3x3 matrix: body axis k in the world."""
    return (R[k], R[3 + k], R[6 + k])


@leaf
def free_turn(R0, axis, gamma_1, gamma_2):
    """The relative angular acceleration that the rows v1 . v3 and v2 . v3 ask for, up to the hinge axis itself, in the
    world (theory.md, eq. (8.46)); v1 and v2 are the chassis' x and y axes, `axis` is v3 in chassis axes."""
    k = 1.0 / axis[2]
    return apply(R0, (-k * gamma_2, k * gamma_1, 0.0))


@leaf
def _fed_back(rate, r, x, chassis, R0, offset, own, speed):
    """(drift, turn) of Baumgarte's feedback at `rate` [1/s] of what is missing at a hinge (theory.md, eq. (8.30))."""
    axis, w_world = column(quaternion.rotation_matrix(x.attitude), 2), apply(R0, chassis.omega_body)
    gap = subtract(subtract(x.position_world, chassis.position_world), offset)
    slip = subtract(subtract(x.velocity_world, chassis.velocity_world), cross(w_world, offset))
    drift = add(scale(-2.0 * rate, slip), scale(-rate * rate, gap))
    a = apply_transposed(R0, axis)
    relative = subtract(own, w_world)
    swing = apply_transposed(R0, cross(relative, axis))
    back = rate * rate
    if r.spins > 0.0:
        both = (-2.0 * rate * swing[0] - back * a[0], -2.0 * rate * swing[1] - back * a[1])
        return drift, free_turn(R0, a, both[0], both[1])
    late = subtract(relative, scale(speed, column(R0, 2)))
    return drift, add(scale(-2.0 * rate, late), free_turn(R0, a, -back * a[0], -back * a[1]))


@leaf
def _leaf(r, x, t, chassis, R0, w_world, gravity, feedback):
    """What `arrow` must know of rotor r in state x, in world axes; w_world: angular velocity of the chassis."""
    w = chassis.omega_body
    R = quaternion.rotation_matrix(x.attitude)
    own = apply(R, x.omega_body)
    axis = column(R, 2)
    offset = apply(R0, r.offset)
    if r.spins > 0.0:
        a, o = apply_transposed(R0, axis), apply_transposed(R0, own)
        slip = subtract(w, o)
        square, wa = dot(slip, slip), dot(w, a)
        twice = 2.0 * wa - x.omega_body[2]
        gamma_1 = a[0] * square - w[0] * wa + o[0] * twice
        gamma_2 = a[1] * square - w[1] * wa + o[1] * twice
        speed, turn, torque = 0.0, free_turn(R0, a, gamma_1, gamma_2), r.drive
    else:
        speed = r.speed + r.drive * t
        turn, torque = apply(R0, (w[1] * speed, -w[0] * speed, r.drive)), 0.0
    drift = cross(w_world, cross(w_world, offset))
    if feedback > 0.0:
        more, swing = _fed_back(feedback, r, x, chassis, R0, offset, own, speed)
        drift, turn = add(drift, more), add(turn, swing)
    return Leaf(
        r.mass,
        felt(R, r.inertia, r.spins),
        offset,
        axis,
        r.inertia[2],
        r.spins,
        torque,
        drift,
        turn,
        add(scale(r.mass, gravity), r.wrench.force_world),
        apply(R, subtract(r.wrench.torque_body, cross(x.omega_body, multiply(r.inertia, x.omega_body)))),
    )


@leaf
def solve(p, t, x):
    """Everything the fast path knows at a state: `arrow.Result`, in world axes."""
    R0 = quaternion.rotation_matrix(x.chassis.attitude)
    w = x.chassis.omega_body
    w_world = apply(R0, w)
    core = Core(
        p.mass,
        rotated(R0, p.inertia),
        add(scale(p.mass, p.gravity), p.wrench.force_world),
        apply(R0, subtract(p.wrench.torque_body, cross(w, multiply(p.inertia, w)))),
    )
    r, b = p.rotors, x.propellers
    leaves = (
        _leaf(r[0], b[0], t, x.chassis, R0, w_world, p.gravity, p.feedback),
        _leaf(r[1], b[1], t, x.chassis, R0, w_world, p.gravity, p.feedback),
        _leaf(r[2], b[2], t, x.chassis, R0, w_world, p.gravity, p.feedback),
        _leaf(r[3], b[3], t, x.chassis, R0, w_world, p.gravity, p.feedback),
    )
    return eliminate(core, leaves)


@leaf
def _rate(x, acceleration, angular_acceleration):
    own = quaternion.rotation_matrix(x.attitude)
    return BodyState(x.velocity_world, x.omega_body, acceleration, apply_transposed(own, angular_acceleration))


@kernel
def rate(p, t, x):
    """Tangent of the state: index-1 equations of motion by elimination (theory.md, eqs. (8.40)-(8.46))."""
    s = solve(p, t, x)
    b, l1, l2, l3, l4 = x.propellers, s.leaves[0], s.leaves[1], s.leaves[2], s.leaves[3]
    return FiveBodies(
        _rate(x.chassis, s.acceleration, s.angular_acceleration),
        (
            _rate(b[0], l1.acceleration, l1.angular_acceleration),
            _rate(b[1], l2.acceleration, l2.angular_acceleration),
            _rate(b[2], l3.acceleration, l3.angular_acceleration),
            _rate(b[3], l4.acceleration, l4.angular_acceleration),
        ),
    )


RATES[Machine] = rate


def machine(
    drone,
    gravity,
    drive=(0.0, 0.0, 0.0, 0.0),
    speeds=(0.0, 0.0, 0.0, 0.0),
    wrenches=(NO_WRENCH,) * 5,
    feedback=0.0,
) -> Machine:
    """The five bodies of a `delivery_drone.Drone`; `wrenches`: chassis first."""
    rotors = tuple(
        Rotor(
            drone.propeller_mass[k], drone.propeller_inertia[k], drone.hubs[k], drone.spins[k],
            float(drive[k]), float(speeds[k]), wrenches[k + 1],
        )
        for k in range(4)
    )  # fmt: skip
    return Machine(drone.mass, drone.inertia, gravity, wrenches[0], rotors, feedback)


def arrays(x: FiveBodies) -> tuple[np.ndarray, np.ndarray]:
    """The same state for the general engine: configuration (5, 7) and velocity (5, 6). Also takes a tangent apart."""
    bodies = (x.chassis, *x.propellers)
    first = np.array([[*b.position_world, *b.attitude] for b in bodies])
    return first, np.array([[*b.velocity_world, *b.omega_body] for b in bodies])
