"""Jacobian and quadratic velocity vector against numerical differentiation of the residuals along a motion."""

import numpy as np
import pytest
from multibody_angles import euler_from_quaternion, quaternion_from_euler

from lapwing.dynamics.multibody.body_kinematics import add_increment, place
from lapwing.dynamics.multibody.constraints import velocity_defect
from lapwing.dynamics.multibody.stabilisation import rows
from lapwing.dynamics.multibody.system import GROUND, Body, DrivingConstraint, Revolute, assemble

RNG = np.random.default_rng(3)
BODIES = [Body(f"b{k}", 1.0 + k, (1.0, 2.0, 2.5)) for k in range(3)]
JOINTS = [
    Revolute("ground", GROUND, 0, (0.3, -0.2, 0.1), (0.5, 0.1, 0.4), (1, 2, 3), (0, 1, 1)),
    Revolute("chain", 0, 1, (-0.3, 0.2, 0.1), (0.5, 0.0, -0.4), (1, -2, 3), (2, 1, 1)),
    Revolute("back", 2, 1, (0.3, 0.7, 0.1), (0.1, 0.1, 0.2), (0, 0, 1), (1, 0, 0)),
]
DRIVES = [DrivingConstraint("motor", 2, 0, (1, 1, 0)), DrivingConstraint("base", 1, GROUND, (0, 1, 2))]
SYSTEM = assemble(BODIES, JOINTS, DRIVES)
DRIVE = np.array([[2.0, 0.7], [-1.5, 0.4]])


def state(kind):
    """Return a random state, off all constraints."""
    q = np.hstack([RNG.normal(size=(3, 3)), RNG.normal(size=(3, 4))])
    q[:, 3:] /= np.linalg.norm(q[:, 3:], axis=1)[:, None]
    v = RNG.normal(size=(3, 6))
    return (q, v) if kind == "quaternion" else euler_from_quaternion(q, v)


@pytest.mark.parametrize("kind", ["quaternion", "euler"])
def test_rows_are_derivatives_of_residuals(kind):
    q, v = state(kind)
    acceleration = RNG.normal(size=(3, 6))
    h = 1e-5

    def at(t):
        """Return the state at t of a second-order motion with this velocity and acceleration."""
        moved = add_increment(q, t * v + 0.5 * t * t * acceleration)
        speed = v + t * acceleration
        now = DRIVE + np.outer([t, t], [0.0, 0.0])
        now[:, 0] += t * DRIVE[:, 1]
        return moved, speed, now

    def equations(t):
        moved, speed, now = at(t)
        return rows(SYSTEM.arrays, moved, speed, now)[1], speed

    e, speed = equations(0.0)
    rate = (equations(h)[0].residual - equations(-h)[0].residual) / (2.0 * h)
    slip = velocity_defect(e, speed)
    np.testing.assert_allclose(slip[: len(rate)], rate, atol=1e-8)
    change = (velocity_defect(*equations(h)) - velocity_defect(*equations(-h))) / (2.0 * h)
    # for quaternions the velocity is omega_body to first order in t, which suffices: the rows are linear in it
    expected = e.jacobian_t.T @ acceleration.ravel() - e.gamma
    np.testing.assert_allclose(change, expected, atol=1e-7)


def test_drive_turns_body_i_about_axis_of_body_j():
    q, v = state("quaternion")
    v[:] = 0.0
    p = place(q, v)
    axis = p.rotation[0].reshape(3, 3) @ np.array([1, 1, 0]) / np.sqrt(2.0)
    v[2, 3:] = p.rotation[2].reshape(3, 3).T @ (2.0 * axis)  # the imposed speed
    _, e = rows(SYSTEM.arrays, q, v, DRIVE)
    np.testing.assert_allclose(velocity_defect(e, v)[15:18], 0.0, atol=1e-14)


def test_two_coordinates_place_bodies_alike():
    q, v = state("quaternion")
    angles, rates = euler_from_quaternion(q, v)
    a, b = place(q, v), place(angles, rates)
    for field in ("position", "rotation", "velocity", "omega"):
        np.testing.assert_allclose(getattr(a, field), getattr(b, field), atol=1e-13)
    back, twist = quaternion_from_euler(angles, rates)
    np.testing.assert_allclose(place(back, twist).rotation, a.rotation, atol=1e-13)
    np.testing.assert_allclose(twist, v, atol=1e-13)
