"""XYZ Euler (Cardan) angles, exactly as in the paper's section 4.2: A = Ax(roll) Ay(pitch) Az(yaw).

Angles are (roll, pitch, yaw) [rad]; A takes body coordinates to world; matrices are nine floats in row order.
"""

from lapwing.dynamics.vector import add, apply, apply_transposed, cross, matmul, transpose
from lapwing.kernels import always_inline, math

SINGULAR = 1e-6  # |cos(pitch)| below which the angles count as singular: their rates lose six of sixteen digits


@always_inline
def rotation(angles):
    """Return A of shape (3, 3), body to world (theory, eq. (8.1))."""
    sx, cx = math.sincos(angles[0])
    sy, cy = math.sincos(angles[1])
    sz, cz = math.sincos(angles[2])
    return (
        cy * cz, -cy * sz, sy,
        cx * sz + sx * sy * cz, cx * cz - sx * sy * sz, -sx * cy,
        sx * sz - cx * sy * cz, sx * cz + cx * sy * sz, cx * cy,
    )  # fmt: skip


@always_inline
def rate_matrix(angles):
    """Return G-bar: omega_body = G-bar d(angles)/dt (theory, eq. (8.2)); its determinant is cos(pitch)."""
    sy, cy = math.sincos(angles[1])
    sz, cz = math.sincos(angles[2])
    return (cy * cz, sz, 0.0, -cy * sz, cz, 0.0, sy, 0.0, 1.0)


@always_inline
def rate_matrix_derivative(angles, rates):
    """Return d(G-bar)/dt for angle rates [rad/s] (theory, eq. (8.3))."""
    sy, cy = math.sincos(angles[1])
    sz, cz = math.sincos(angles[2])
    dy, dz = rates[1], rates[2]
    return (
        -sy * cz * dy - cy * sz * dz, cz * dz, 0.0,
        sy * sz * dy - cy * cz * dz, -sz * dz, 0.0,
        cy * dy, 0.0, 0.0,
    )  # fmt: skip


@always_inline
def rotational_mass(G, inertia):
    """Return G-bar^T I G-bar, the rotational block of the mass matrix (theory, eq. (8.5))."""
    return matmul(transpose(G), matmul(inertia, G))


@always_inline
def quadratic_velocity(G, inertia, omega_body, bias):
    """Return -G-bar^T (omega x I omega + I bias) with bias = d(G-bar)/dt d(angles)/dt (theory, eq. (8.6))."""
    gyroscopic = cross(omega_body, apply(inertia, omega_body))
    total = add(gyroscopic, apply(inertia, bias))
    return apply_transposed(G, (-total[0], -total[1], -total[2]))


@always_inline
def angles_of(R):
    """Return (roll, pitch, yaw) of a rotation matrix, pitch in [-pi/2, pi/2] (theory, eq. (8.4))."""
    return (math.atan2(-R[5], R[8]), math.atan2(R[2], math.hypot(R[0], R[1])), math.atan2(-R[1], R[0]))


@always_inline
def rates_of(angles, omega_body):
    """Return d(angles)/dt [rad/s] of an angular velocity; divides by cos(pitch) (theory, eq. (8.4))."""
    sy, cy = math.sincos(angles[1])
    sz, cz = math.sincos(angles[2])
    roll = (cz * omega_body[0] - sz * omega_body[1]) / cy
    return (roll, sz * omega_body[0] + cz * omega_body[1], omega_body[2] - sy * roll)
