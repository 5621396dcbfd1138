"""Five bodies of the multirotor in XYZ Euler angles on the general engine, which factorises every constraint row.

A formulation of the multirotor, for comparison with `multirotor_multibody`. It is slower, and does not support a pitch
of 90 degrees: there the tangent becomes infinite, which `singular` detects.
"""

from typing import NamedTuple

import numpy as np

from lapwing.dynamics.lie import quaternion
from lapwing.dynamics.multibody import cardan_angles, five_body_stabilisation, stabilisation
from lapwing.dynamics.multibody.augmented import RANK_TOLERANCE, solve
from lapwing.dynamics.multibody.five_bodies import BodyState, FiveBodies
from lapwing.dynamics.multibody.mechanisms import drone_system
from lapwing.dynamics.multibody.system import Arrays
from lapwing.dynamics.vector import ZERO, Vec3, apply
from lapwing.dynamics.vehicles import multirotor_multibody
from lapwing.dynamics.vehicles import multirotor_multibody_equations as on_se3
from lapwing.dynamics.vehicles.multirotor_equations import (
    FORMULATIONS,
    Formulation,
    MultirotorParameters,
    MultirotorState,
)
from lapwing.kernels import always_inline, kernel, math, noinline

NEAR = 0.02  # cosine of the pitch below which the angles are not used: 1 degree from the singularity


class EulerBody(NamedTuple):
    """State of one body: its coordinates and their rates."""

    position_world: Vec3  # [m] of the centre of mass
    angles: Vec3  # roll, pitch, yaw [rad]
    velocity_world: Vec3  # [m/s]
    angle_rates: Vec3  # [rad/s]


class FiveEulerBodies(NamedTuple):
    """State of chassis and propellers."""

    body: tuple[EulerBody, EulerBody, EulerBody, EulerBody, EulerBody]


@kernel
def _body(b):
    omega = apply(cardan_angles.rate_matrix(b.angles), b.angle_rates)
    attitude = quaternion.from_matrix(cardan_angles.rotation(b.angles))
    return BodyState(b.position_world, attitude, b.velocity_world, omega)


@kernel
def five(x):
    """Convert the state to SE(3)."""
    b = x.body
    return FiveBodies(_body(b[0]), (_body(b[1]), _body(b[2]), _body(b[3]), _body(b[4])))


@kernel
def _euler_body(b):
    angles = cardan_angles.angles_of(quaternion.rotation_matrix(b.attitude))
    return EulerBody(b.position_world, angles, b.velocity_world, cardan_angles.rates_of(angles, b.omega_body))


@kernel
def of_five(x):
    """Convert the state to Euler angles."""
    p = x.propellers
    return FiveEulerBodies(
        (_euler_body(x.chassis), _euler_body(p[0]), _euler_body(p[1]), _euler_body(p[2]), _euler_body(p[3]))
    )


@kernel
def _arrays(x):
    """Return the configuration and velocity for the general engine, shapes (5, 6)."""
    q, v = np.empty((5, 6)), np.empty((5, 6))
    for i in range(5):
        b = x.body[i]
        for k in range(3):
            q[i, k], q[i, 3 + k] = b.position_world[k], b.angles[k]
            v[i, k], v[i, 3 + k] = b.velocity_world[k], b.angle_rates[k]
    return q, v


@kernel
def _one(q, v, i):
    return EulerBody(
        (q[i, 0], q[i, 1], q[i, 2]),
        (q[i, 3], q[i, 4], q[i, 5]),
        (v[i, 0], v[i, 1], v[i, 2]),
        (v[i, 3], v[i, 4], v[i, 5]),
    )


@kernel
def _tree(q, v):
    return FiveEulerBodies((_one(q, v, 0), _one(q, v, 1), _one(q, v, 2), _one(q, v, 3), _one(q, v, 4)))


@kernel
def _system(a, p):
    """Return the arrays with the values that effects can change."""
    mass, inertia, gravity = a.mass.copy(), a.inertia.copy(), a.gravity.copy()
    mass[0] = p.mass
    for k in range(3):
        inertia[0, k, k] = p.inertia[k]
        gravity[k] = p.gravity[k]
    return Arrays(mass, inertia, a.joint_bodies, a.joint_points, a.joint_triads, a.drive_bodies, a.drive_axes, gravity)


@kernel
def _drive_motion(a, p):
    """Return the speed and acceleration of each drive, shape (4 or 0, 2)."""
    out = np.empty((len(a.drive_bodies), 2))
    for k in range(len(out)):
        r = p.rotors[max(a.drive_bodies[k, 0], a.drive_bodies[k, 1]) - 1]  # the chassis is body 0
        out[k, 0], out[k, 1] = r.speed, r.drive
    return out


@kernel
def _wrenches(p):
    """Return forces and torques on the bodies, shape (5, 6); a motor acts on propeller and chassis."""
    out = np.empty((5, 6))
    for k in range(3):
        out[0, k], out[0, 3 + k] = p.wrench.force_world[k], p.wrench.torque_body[k]
    for i in range(4):
        r = p.rotors[i]
        for k in range(3):
            out[i + 1, k], out[i + 1, 3 + k] = r.wrench.force_world[k], r.wrench.torque_body[k]
        out[i + 1, 5] += r.spins * r.drive
        out[0, 5] -= r.spins * r.drive
    return out


@kernel
def _ranks(a):
    """Return the ranks of the hinges' rows and of all rows: two of a drive's three rows are its hinge's."""
    hinge_rows = 5 * len(a.joint_bodies)
    return hinge_rows, hinge_rows + len(a.drive_bodies)


@always_inline
def _upright(b):
    """Return True if a pitch is not at 90 degrees; it changes continuously, so no step skips it."""
    return math.cos(b.angles[1]) > NEAR


@kernel
def _all_upright(x):
    b = x.body
    return _upright(b[0]) and _upright(b[1]) and _upright(b[2]) and _upright(b[3]) and _upright(b[4])


@always_inline
def _singular_tangent(b):
    """Return the tangent of one body at the singularity: infinite for a singular pitch, otherwise zero."""
    return EulerBody(ZERO, (0.0, 0.0 if _upright(b) else math.inf, 0.0), ZERO, ZERO)


@noinline
def motion_of(layout, x):
    """Return the Motion of the chassis with the speeds of the rotors."""
    return on_se3.motion_of(layout, five(x))


@noinline
def rate(u, t, x):
    """Return the tangent by the augmented formulation (theory, eqs. (8.20)-(8.22)), which divides by cos(pitch)."""
    if not _all_upright(x):
        b = x.body
        return FiveEulerBodies(
            (
                _singular_tangent(b[0]),
                _singular_tangent(b[1]),
                _singular_tangent(b[2]),
                _singular_tangent(b[3]),
                _singular_tangent(b[4]),
            )
        )
    p = on_se3.machine(u, t, motion_of(u.parameters.layout, x))
    bodies = u.parameters.layout.bodies
    a = _system(bodies.arrays, p)
    q, v = _arrays(x)
    f = bodies.feedback
    s, _ = solve(a, q, v, _wrenches(p), _drive_motion(a, p), 2.0 * f, f * f, RANK_TOLERANCE, _ranks(a)[1])
    return _tree(v, s.acceleration)


@noinline
def apply_constraint_impulse(u, x):
    """See `multirotor_multibody_equations.apply_constraint_impulse`."""
    p = on_se3.without_loads(u, motion_of(u.parameters.layout, x))
    a = _system(u.parameters.layout.bodies.arrays, p)
    q, v = _arrays(x)
    q, v = stabilisation.project(a, q, v, _drive_motion(a, p), _ranks(a))
    return _tree(q, v)


@noinline
def project(u, x):
    """Return the bodies with stabilised constraints."""
    bodies = u.parameters.layout.bodies
    if bodies.hold == five_body_stabilisation.NONE or not _all_upright(x):
        return x
    if bodies.hold == five_body_stabilisation.PROJECTION:
        return apply_constraint_impulse(u, x)
    p = on_se3.without_loads(u, motion_of(u.parameters.layout, x))
    a = _system(bodies.arrays, p)
    q, v = _arrays(x)
    q, v = stabilisation.partition(a, q, v, _drive_motion(a, p), _ranks(a))
    return _tree(q, v)


@kernel
def accelerations(u, t, x):
    """Return (linear [m/s^2] in the world, angular [rad/s^2] in the body) of the chassis."""
    b, tangent = x.body[0], rate(u, t, x).body[0]
    G, change = cardan_angles.rate_matrix(b.angles), cardan_angles.rate_matrix_derivative(b.angles, b.angle_rates)
    from_rates, from_angles = apply(G, tangent.angle_rates), apply(change, b.angle_rates)
    angular = (from_rates[0] + from_angles[0], from_rates[1] + from_angles[1], from_rates[2] + from_angles[2])
    return tangent.velocity_world, angular


FORMULATIONS[FiveEulerBodies] = Formulation(motion_of, rate, project, accelerations)


def singular(x: FiveEulerBodies) -> int:
    """Return the body whose pitch has reached 90 degrees in a non-finite state; -1 if none has."""
    return next((i for i, b in enumerate(x.body) if math.isinf(b.angles[1])), -1)


def parameters(*arguments, **named) -> MultirotorParameters:
    """See `multirotor_multibody.parameters`."""
    return _assemble(multirotor_multibody.parameters(*arguments, **named))


def with_propeller_failure(p: MultirotorParameters, k: int, becomes: str) -> MultirotorParameters:
    """See `multirotor_multibody.with_propeller_failure`."""
    return _assemble(multirotor_multibody.with_propeller_failure(p, k, becomes))


def _assemble(p: MultirotorParameters) -> MultirotorParameters:
    bodies = p.layout.bodies
    drone = bodies.drone
    system = drone_system(drone, tuple(spins == 0.0 for spins in drone.spins))
    for k, is_attached in enumerate(drone.held):
        system = system if is_attached else system.without(f"hinge {k + 1}")
    return p._replace(layout=p.layout._replace(bodies=bodies._replace(arrays=system.arrays)))


def initial_state(*arguments, **named) -> MultirotorState:
    """See `multirotor_multibody.initial_state`."""
    state = multirotor_multibody.initial_state(*arguments, **named)
    return state._replace(motion=of_five(state.motion))
