"""Initial states are made consistent, or rejected with the names of the violated rows."""

import numpy as np
import pytest
from multibody_angles import euler_from_quaternion
from test_augmented import state

from lapwing.dynamics.multibody.body_kinematics import add_increment
from lapwing.dynamics.multibody.mechanisms import bricard, drone_system, four_bars
from lapwing.dynamics.multibody.simulation import check, consistent


def test_violated_rows_are_named():
    system, q, v = four_bars()
    check(system, q, v)
    q[3, 1] += 0.01
    v[0, 2] = 0.3
    with pytest.raises(ValueError, match=r"left 0: point y \(position, -0.01\).*base 0: point z \(velocity, -0.3\)"):
        check(system, q, v)


@pytest.mark.parametrize("build", [four_bars, bricard])
def test_disturbed_mechanism_is_closed_again(build):
    system, q, v = build()
    rng = np.random.default_rng(1)
    q, v = consistent(system, add_increment(q, 0.02 * rng.normal(size=v.shape)), v + 0.1 * rng.normal(size=v.shape))
    check(system, q, v, tolerance=1e-12)


@pytest.mark.parametrize("kind", ["quaternion", "euler"])
def test_driven_drone_gets_its_imposed_speeds(kind):
    drone, q, v, _, drive = state(np.random.default_rng(2))
    system = drone_system(drone)
    at_rest = np.zeros_like(v)
    if kind == "euler":
        q, at_rest = euler_from_quaternion(q, at_rest)
    q, v = consistent(system, q, at_rest, drive)
    check(system, q, v, drive, tolerance=1e-10)
    # nothing pushed from outside: the correction leaves the total momentum zero
    if kind == "quaternion":
        np.testing.assert_allclose(system.arrays.mass @ v[:, :3], 0.0, atol=1e-12)


def test_inconsistent_initial_state_is_rejected():
    system, q, v = four_bars()
    q[4, 0] += 1.0
    with pytest.raises(ValueError, match=r"initial state violates .* left 1: point x"):
        consistent(system, q, v)
