"""Geometric tracking control on SE(3) as compiled code, which runs in the compiled loop without Python.

T. Lee, M. Leok, N. H. McClamroch: Geometric tracking control of a quadrotor UAV on SE(3), 49th IEEE Conference on
Decision and Control, 2010, eqs. (7) to (16), written for z up; with an integral of the position error, which
compensates a steady wind (F. Goodarzi, D. Lee, T. Lee: Geometric nonlinear PID control of a quadrotor UAV on SE(3),
European Control Conference, 2013). The rate of the commanded attitude is the smoothed difference of the last two
commands.
"""

import math
from typing import NamedTuple

from lapwing.plugins import (
    ZERO,
    Mat3,
    ThrustAndMoments,
    Vec3,
    VehicleModel,
    add,
    apply,
    apply_transposed,
    cross,
    dot,
    kernel,
    matmul,
    multiply,
    norm,
    rotation_matrix,
    scale,
    subtract,
    transpose,
    vee,
)

IDENTITY: Mat3 = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


class Parameters(NamedTuple):
    """Gains for a vehicle."""

    rate: float  # [Hz]
    mass: float  # [kg]
    inertia_body: Vec3  # [kg m^2]
    gravity: float  # [m/s^2]
    k_x: float  # [N/m]
    k_v: float  # [N s/m]
    k_i: float  # [N/(m s)]
    k_attitude: Vec3  # [N m] about each body axis
    k_omega: Vec3  # [N m s]
    smoothing: float  # weight of a new rate of the commanded attitude in the smoothed one


class State(NamedTuple):
    """Controller state."""

    integral_world: Vec3  # [m s] integral of the position error
    R_commanded: Mat3
    omega_commanded: Vec3  # [rad/s] in axes of the commanded attitude
    started: bool


def build(
    vehicle: VehicleModel,
    position: float = 3.5,
    damping: float = 0.9,
    integral: float = 1.0,
    attitude: float = 15.0,
    yaw: float = 4.0,
    smoothing: float = 10.0,
) -> tuple[Parameters, State]:
    """Return parameters and initial state.

    Args:
        vehicle: model of the vehicle.
        position: bandwidth of the position loop [rad/s].
        damping: damping ratio of all loops; 1 is critical.
        integral: rate of the compensation of a steady force [rad/s].
        attitude: bandwidth of the roll and pitch loops [rad/s].
        yaw: bandwidth of the yaw loop [rad/s].
        smoothing: bandwidth of the rate of the commanded attitude [rad/s].
    """
    m, (ix, iy, iz) = vehicle.mass, vehicle.inertia_body
    rate = 1.0 / vehicle.interval
    p = Parameters(
        rate,
        m,
        vehicle.inertia_body,
        vehicle.gravity,
        m * position**2,
        2.0 * damping * m * position,
        m * position**2 * integral,
        (ix * attitude**2, iy * attitude**2, iz * yaw**2),
        (2.0 * damping * ix * attitude, 2.0 * damping * iy * attitude, 2.0 * damping * iz * yaw),
        1.0 - math.exp(-smoothing / rate),
    )
    return p, State(ZERO, IDENTITY, ZERO, False)


@kernel
def commanded_attitude(force_world, yaw):
    """Return body axes in the world, the third along a force and the first towards a heading [rad]."""
    b3 = scale(1.0 / max(norm(force_world), 1e-6), force_world)
    b2 = cross(b3, (math.cos(yaw), math.sin(yaw), 0.0))
    b2 = scale(1.0 / max(norm(b2), 1e-6), b2)
    b1 = cross(b2, b3)
    return (b1[0], b2[0], b3[0], b1[1], b2[1], b3[1], b1[2], b2[2], b3[2])


@kernel
def step(p, s, time, estimate, setpoint):
    """Return state and command at `time` [s]."""
    R = rotation_matrix(estimate.attitude)
    omega = estimate.omega_body
    e_x = subtract(estimate.position_world, setpoint.position_world)
    e_v = subtract(estimate.velocity_world, setpoint.velocity_world)
    integral = add(s.integral_world, scale(1.0 / p.rate, e_x))
    feedback = add(add(scale(p.k_x, e_x), scale(p.k_v, e_v)), scale(p.k_i, integral))
    acceleration = add(setpoint.acceleration_world, (0.0, 0.0, p.gravity))
    force = subtract(scale(p.mass, acceleration), feedback)
    R_c = commanded_attitude(force, setpoint.yaw)  # eq. (12)
    omega_c = s.omega_commanded
    if s.started:
        rotation = matmul(transpose(s.R_commanded), R_c)
        fresh = scale(p.rate, vee(rotation))
        omega_c = add(omega_c, scale(p.smoothing, subtract(fresh, omega_c)))
    error = matmul(transpose(R_c), R)
    e_R = vee(error)  # eq. (10)
    omega_desired = apply_transposed(error, omega_c)
    e_omega = subtract(omega, omega_desired)  # eq. (11)
    gyroscopic = cross(omega, multiply(p.inertia_body, omega))
    transport = multiply(p.inertia_body, cross(omega, omega_desired))
    restoring = add(multiply(p.k_attitude, e_R), multiply(p.k_omega, e_omega))
    moments = subtract(subtract(gyroscopic, transport), restoring)  # eq. (16)
    thrust = dot(force, apply(R, (0.0, 0.0, 1.0)))  # eq. (15)
    roll_pitch = (math.atan2(R_c[7], R_c[8]), -math.asin(min(max(R_c[6], -1.0), 1.0)))
    return State(integral, R_c, omega_c, True), ThrustAndMoments(thrust, moments, roll_pitch)
