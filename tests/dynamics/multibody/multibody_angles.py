"""Conversion of body states between Euler angles and quaternions."""

import numpy as np

from lapwing.dynamics.lie import quaternion
from lapwing.dynamics.multibody import cardan_angles
from lapwing.dynamics.multibody.body_kinematics import place


def euler_from_quaternion(configuration, velocity):
    """Convert a state to Euler angles: configuration (n, 7) to (n, 6), velocity (n, 6) to (n, 6).

    Raises:
        ValueError: a body's pitch is at 90 degrees.
    """
    angles_out, rates_out = np.array(configuration[:, :6]), np.array(velocity, float)
    for i in range(len(configuration)):
        angles = cardan_angles.angles_of(quaternion.rotation_matrix(tuple(configuration[i, 3:])))
        if abs(np.cos(angles[1])) < cardan_angles.SINGULAR:
            raise ValueError(f"body {i}: pitch is at 90 degrees, where XYZ Euler angles are singular: use quaternions")
        angles_out[i, 3:] = angles
        rates_out[i, 3:] = cardan_angles.rates_of(angles, tuple(velocity[i, 3:]))
    return angles_out, rates_out


def quaternion_from_euler(configuration, velocity):
    """Convert a state to quaternions: configuration (n, 6) to (n, 7), velocity (n, 6) to (n, 6)."""
    placed = place(np.asarray(configuration, float), np.asarray(velocity, float))
    q = [quaternion.from_matrix(tuple(R)) for R in placed.rotation[:-1]]
    return np.hstack([placed.position[:-1], np.array(q)]), np.hstack([placed.velocity[:-1], placed.omega[:-1]])
