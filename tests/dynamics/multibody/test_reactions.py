"""Joint reactions against closed forms and Newton's third law."""

import numpy as np
import pytest
from multibody_angles import euler_from_quaternion
from multibody_reactions import reactions
from test_augmented import state
from test_mechanisms import pendulum

from lapwing.dynamics.multibody.augmented import accelerations
from lapwing.dynamics.multibody.body_kinematics import place
from lapwing.dynamics.multibody.mechanisms import drone_system

G = 9.81


def test_hanging_and_swinging_pendulum():
    """The hinge carries m g at rest, 3 m g at the bottom of a swing from the horizontal."""
    system, q, v = pendulum()
    down = np.array([[0.0, -1.0, 0.0, np.sqrt(0.5), 0.0, 0.0, -np.sqrt(0.5)]])
    for omega, force in ((0.0, G), (np.sqrt(2.0 * G), 3.0 * G)):
        v = np.array([[omega, 0.0, 0.0, 0.0, 0.0, omega]])
        solution = accelerations(system, down, v)
        r = reactions(system, down, v, solution)["hinge"]
        np.testing.assert_allclose(r.force_world, [0.0, force, 0.0], atol=1e-9)
        np.testing.assert_allclose(r.torque_world, 0.0, atol=1e-9)
    # released at rest, the weight only accelerates: the hinge carries nothing (except the small share of inertia)
    r = reactions(system, q, 0 * v, accelerations(system, q, 0 * v))["hinge"]
    np.testing.assert_allclose(r.force_world, 0.0, atol=1e-7)


@pytest.mark.parametrize("kind", ["quaternion", "euler"])
def test_reactions_close_newton_and_euler_for_every_propeller(kind):
    drone, q, v, wrench, drive = state(np.random.default_rng(20))
    if kind == "euler":
        q, v = euler_from_quaternion(q, v)
    system = drone_system(drone)
    solution = accelerations(system, q, v, wrench, drive)
    all_reactions = reactions(system, q, v, solution, drive)
    p = place(q, v)
    for k in range(1, 5):
        r, R = all_reactions[f"hinge {k}"], p.rotation[k].reshape(3, 3)
        mass, inertia = system.arrays.mass[k], system.arrays.inertia[k]
        load = wrench[k, :3] + mass * np.array([0.0, 0.0, -G])
        np.testing.assert_allclose(r.force_world + load, mass * solution.acceleration[k, :3], atol=1e-9)
        omega_rate = p.rate_matrix[k].reshape(3, 3) @ solution.acceleration[k, 3:] + p.bias[k]
        change = R @ (inertia @ omega_rate + np.cross(p.omega[k], inertia @ p.omega[k]) - wrench[k, 3:])
        np.testing.assert_allclose(r.torque_world, change, atol=1e-9)
        assert r.axial_torque == pytest.approx(change @ R[:, 2], abs=1e-9)


def test_free_hinge_carries_no_torque_about_its_axis():
    drone, q, v, wrench, _ = state(np.random.default_rng(21))
    system = drone_system(drone, (False,) * 4)
    solution = accelerations(system, q, v, wrench)
    assert max(abs(r.axial_torque) for r in reactions(system, q, v, solution).values()) < 1e-12
