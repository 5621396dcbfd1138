"""Kinematics of the bodies from their coordinates; the only module that depends on the kind of coordinates.

A configuration is an array (n, 6) of positions [m] and XYZ Euler angles [rad], or (n, 7) of positions and unit
quaternions (w, x, y, z). Its velocity is an array (n, 6): the coordinates' rates for Euler angles,
(velocity_world [m/s], omega_body [rad/s]) for quaternions.
"""

from typing import NamedTuple

import numpy as np

from lapwing.dynamics.lie import quaternion
from lapwing.dynamics.multibody import cardan_angles
from lapwing.dynamics.vector import IDENTITY, ZERO, apply
from lapwing.kernels import kernel, math, noinline


class BodyKinematics(NamedTuple):
    """Pose and velocity of n bodies; the last entry, index n or -1, is the ground."""

    position: np.ndarray  # (n + 1, 3) [m], world
    rotation: np.ndarray  # (n + 1, 9) body to world, row order
    velocity: np.ndarray  # (n + 1, 3) [m/s], world
    omega: np.ndarray  # (n + 1, 3) [rad/s], body
    rate_matrix: np.ndarray  # (n, 9) omega_body = rate_matrix @ velocity[3:]; the identity for quaternions
    bias: np.ndarray  # (n, 3) remaining angular acceleration [rad/s^2], body; zero for quaternions
    singular: int  # body whose Euler angles are singular, -1 if none


@kernel
def three(a, i):
    """Return row i of an array as a tuple of three."""
    return (a[i, 0], a[i, 1], a[i, 2])


@kernel
def nine(a, i):
    """Return row i of an array as a tuple of nine."""
    return (a[i, 0], a[i, 1], a[i, 2], a[i, 3], a[i, 4], a[i, 5], a[i, 6], a[i, 7], a[i, 8])


@kernel
def put(a, i, values):
    """Write a tuple into row i of an array."""
    for k in range(len(values)):
        a[i, k] = values[k]


@noinline
def place(configuration, velocity):
    """Return the kinematics of the bodies of a configuration (n, 6 or 7) and velocity (n, 6); eqs. (8.1)-(8.3)."""
    n, width = configuration.shape
    p = BodyKinematics(
        np.zeros((n + 1, 3)), np.zeros((n + 1, 9)), np.zeros((n + 1, 3)), np.zeros((n + 1, 3)),
        np.zeros((n, 9)), np.zeros((n, 3)), -1,
    )  # fmt: skip
    singular = -1
    for i in range(n):
        put(p.position, i, three(configuration, i))
        put(p.velocity, i, three(velocity, i))
        rates = (velocity[i, 3], velocity[i, 4], velocity[i, 5])
        if width == 7:
            q = (configuration[i, 3], configuration[i, 4], configuration[i, 5], configuration[i, 6])
            put(p.rotation, i, quaternion.rotation_matrix(q))
            put(p.omega, i, rates)
            put(p.rate_matrix, i, IDENTITY)
        else:
            angles = (configuration[i, 3], configuration[i, 4], configuration[i, 5])
            if abs(math.cos(angles[1])) < cardan_angles.SINGULAR:
                singular = i
            G = cardan_angles.rate_matrix(angles)
            put(p.rotation, i, cardan_angles.rotation(angles))
            put(p.omega, i, apply(G, rates))
            put(p.rate_matrix, i, G)
            put(p.bias, i, apply(cardan_angles.rate_matrix_derivative(angles, rates), rates))
    put(p.rotation, n, IDENTITY)
    put(p.omega, n, ZERO)
    return BodyKinematics(p.position, p.rotation, p.velocity, p.omega, p.rate_matrix, p.bias, singular)


@kernel
def configuration_rate(configuration, velocity):
    """Return the time derivative of the stored numbers of a configuration, same shape."""
    n, width = configuration.shape
    out = np.empty((n, width))
    for i in range(n):
        for k in range(3):
            out[i, k] = velocity[i, k]
        omega = (velocity[i, 3], velocity[i, 4], velocity[i, 5])
        if width == 7:
            q = (configuration[i, 3], configuration[i, 4], configuration[i, 5], configuration[i, 6])
            rate = quaternion.embed(q, omega)
            for k in range(4):
                out[i, 3 + k] = rate[k]
        else:
            for k in range(3):
                out[i, 3 + k] = omega[k]
    return out


@kernel
def add_increment(configuration, step):
    """Return the configuration plus an increment (n, 6); a body rotation vector for quaternions."""
    n, width = configuration.shape
    out = configuration.copy()
    for i in range(n):
        for k in range(3):
            out[i, k] += step[i, k]
        turn = (step[i, 3], step[i, 4], step[i, 5])
        if width == 7:
            q = (configuration[i, 3], configuration[i, 4], configuration[i, 5], configuration[i, 6])
            turned = quaternion.normalise(quaternion.retract(q, turn))
            for k in range(4):
                out[i, 3 + k] = turned[k]
        else:
            for k in range(3):
                out[i, 3 + k] += turn[k]
    return out
