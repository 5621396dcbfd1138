"""Simulation of several bodies, and Cardan angles."""

import math

import numpy as np
import pytest
from multibody_angles import euler_from_quaternion, quaternion_from_euler
from multibody_energy import energy
from scipy.spatial.transform import Rotation
from test_augmented import PAPER

from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.multibody import cardan_angles
from lapwing.dynamics.multibody.delivery_drone import delivery_drone
from lapwing.dynamics.multibody.five_bodies import BodyState, arrays, machine
from lapwing.dynamics.multibody.five_body_stabilisation import assembled_state
from lapwing.dynamics.multibody.mechanisms import drone_system, four_bars
from lapwing.dynamics.multibody.simulation import simulate

SPEEDS = (40.0, -30.0, 35.0, -45.0)


def tumbling():
    drone = delivery_drone(**PAPER)
    chassis = BodyState((0.0, 0.0, 10.0), Quaternion(0.8, 0.0, 0.6, 0.0), (1.0, 2.0, 3.0), (0.3, 0.5, -0.4))
    return drone, *arrays(assembled_state(machine(drone, (0.0, 0.0, -9.81)), chassis, (0.1, 0.2, 0.3, 0.4), SPEEDS))


@pytest.mark.long
@pytest.mark.parametrize("stabilisation", ["none", "baumgarte", "partitioning", "projection"])
def test_order_four_with_every_stabilisation(stabilisation):
    drone, q, v = tumbling()
    system = drone_system(drone, (False,) * 4)
    ends = []
    for n in (20, 40, 640):
        motion = simulate(system, q, v, 0.1 / n, n, stabilisation, record_every=n)
        ends.append(np.hstack([np.abs(motion.configuration[-1]), motion.velocity[-1]]))
    order = np.log2(np.abs(ends[0] - ends[2]).max() / np.abs(ends[1] - ends[2]).max())
    assert order > 3.6, order


@pytest.mark.parametrize("stabilisation", ["partitioning", "projection"])
@pytest.mark.parametrize("driven", [True, False])
def test_euler_and_quaternion_coordinates_fly_alike(stabilisation, driven):
    drone, q, v = tumbling()
    system = drone_system(drone, (driven,) * 4)
    drive = np.array([[s, 3.0] for s in SPEEDS]) if driven else None
    wrench = np.zeros((5, 6))
    wrench[0] = [1.0, 2.0, 95.0, 0.1, -0.2, 0.1]
    angles, rates = euler_from_quaternion(q, v)
    n = 400
    first = simulate(system, q, v, 0.2 / n, n, stabilisation, wrench=wrench, drive=drive, record_every=n)
    second = simulate(system, angles, rates, 0.2 / n, n, stabilisation, wrench=wrench, drive=drive, record_every=n)
    back, twist = quaternion_from_euler(second.configuration[-1], second.velocity[-1])
    np.testing.assert_allclose(back[:, :3], first.configuration[-1, :, :3], atol=1e-7)
    np.testing.assert_allclose(np.abs(back[:, 3:]), np.abs(first.configuration[-1, :, 3:]), atol=1e-6)
    np.testing.assert_allclose(twist, first.velocity[-1], atol=1e-4)
    assert max(first.position_defect[-1], second.position_defect[-1]) < 1e-12
    assert max(first.velocity_defect[-1], second.velocity_defect[-1]) < 1e-10


def test_energy_equals_sum_over_bodies():
    system, q, v = four_bars(2, speed=1.0)
    kinetic, potential = energy(system, q, v)
    assert kinetic == pytest.approx(0.5 * (3.0 / 3.0 + 2.0))  # three cranks about their ends, two couplers
    assert potential == pytest.approx(9.81 * (3 * 0.5 + 2))


def test_invalid_arguments_are_rejected():
    system, q, v = four_bars()
    with pytest.raises(ValueError, match="unknown stabilisation 'glue': choose one of none, partitioning"):
        simulate(system, q, v, 1e-3, 1, "glue")
    with pytest.raises(ValueError, match="step must be positive, not 0"):
        simulate(system, q, v, 0.0, 1)


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
