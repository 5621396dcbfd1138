"""XYZ Euler angles against products of elementary rotations and numerical differentiation."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lapwing.dynamics.multibody import cardan_angles

ANGLES, RATES = np.array([0.7, -0.9, 2.3]), np.array([1.1, -0.4, 0.8])


def matrix(values):
    return np.array(values).reshape(3, 3)


def test_rotation_is_roll_then_pitch_then_yaw_of_turned_axes():
    np.testing.assert_allclose(
        matrix(cardan_angles.rotation(ANGLES)), Rotation.from_euler("XYZ", ANGLES).as_matrix(), atol=1e-15
    )


def test_rate_matrix_maps_rates_to_body_angular_velocity():
    h = 1e-6
    change = matrix(cardan_angles.rotation(ANGLES + h * RATES)) - matrix(cardan_angles.rotation(ANGLES - h * RATES))
    skew = matrix(cardan_angles.rotation(ANGLES)).T @ change / (2.0 * h)
    omega = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    np.testing.assert_allclose(matrix(cardan_angles.rate_matrix(ANGLES)) @ RATES, omega, atol=1e-9)
    assert np.linalg.det(matrix(cardan_angles.rate_matrix(ANGLES))) == pytest.approx(math.cos(ANGLES[1]))


def test_rate_matrix_derivative():
    h = 1e-6
    change = matrix(cardan_angles.rate_matrix(ANGLES + h * RATES)) - matrix(
        cardan_angles.rate_matrix(ANGLES - h * RATES)
    )
    np.testing.assert_allclose(
        matrix(cardan_angles.rate_matrix_derivative(ANGLES, RATES)), change / (2.0 * h), atol=1e-9
    )


def test_angles_and_rates_return():
    np.testing.assert_allclose(cardan_angles.angles_of(cardan_angles.rotation(ANGLES)), ANGLES, atol=1e-15)
    omega = tuple(matrix(cardan_angles.rate_matrix(ANGLES)) @ RATES)
    np.testing.assert_allclose(cardan_angles.rates_of(ANGLES, omega), RATES, atol=1e-14)


def test_mass_and_quadratic_velocity_are_lagranges():
    """d/dt (dT/d rates) - dT/d angles = M angles'' - Q_v, by differences of T = omega . I omega / 2."""
    inertia = np.array([[2.0, 0.1, -0.2], [0.1, 3.0, 0.3], [-0.2, 0.3, 2.5]])

    def momentum(angles, rates):
        G = matrix(cardan_angles.rate_matrix(angles))
        return G.T @ inertia @ G @ rates

    def kinetic(angles):
        omega = matrix(cardan_angles.rate_matrix(angles)) @ RATES
        return 0.5 * omega @ inertia @ omega

    h, eye = 1e-5, np.eye(3)
    convective = (momentum(ANGLES + h * RATES, RATES) - momentum(ANGLES - h * RATES, RATES)) / (2.0 * h)
    gradient = np.array([(kinetic(ANGLES + h * e) - kinetic(ANGLES - h * e)) / (2.0 * h) for e in eye])
    G = cardan_angles.rate_matrix(ANGLES)
    bias = tuple(matrix(cardan_angles.rate_matrix_derivative(ANGLES, RATES)) @ RATES)
    omega = tuple(matrix(G) @ RATES)
    ours = cardan_angles.quadratic_velocity(G, tuple(inertia.ravel()), omega, bias)
    np.testing.assert_allclose(ours, gradient - convective, atol=1e-8)
    M = np.array([momentum(ANGLES, e) for e in eye])
    np.testing.assert_allclose(matrix(cardan_angles.rotational_mass(G, tuple(inertia.ravel()))), M, atol=1e-14)
