"""The fast path on redundant states equals the general path to round-off, on and off the constraints."""

import numpy as np
import pytest
from multibody_reactions import reactions
from test_augmented import PAPER
from test_delivery_drone import without_propeller

from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.multibody import augmented
from lapwing.dynamics.multibody.augmented import accelerations
from lapwing.dynamics.multibody.body_kinematics import add_increment
from lapwing.dynamics.multibody.delivery_drone import delivery_drone
from lapwing.dynamics.multibody.five_bodies import BodyState, FiveBodies, Wrench, arrays, machine, rate
from lapwing.dynamics.multibody.five_bodies import reactions as from_chassis
from lapwing.dynamics.multibody.five_body_stabilisation import assembled_state
from lapwing.dynamics.multibody.mechanisms import drone_system

pytestmark = pytest.mark.long

GRAVITY = (0.0, 0.0, -9.81)


def scene(rng, driven):
    """Return a random (drone, machine, five-body state, wrench, speeds, drive)."""
    drone = delivery_drone(**PAPER, driven=driven)
    speeds, drive = rng.uniform(-400.0, 400.0, 4), rng.normal(size=4)
    wrench = rng.normal(size=(5, 6)) * [10, 10, 10, 1, 1, 1]
    wrench[1:, 3:] *= 0.01
    loads = tuple(Wrench(tuple(row[:3]), tuple(row[3:])) for row in wrench.tolist())
    p = machine(drone, GRAVITY, drive, speeds, loads)
    q = rng.normal(size=4)
    q /= np.linalg.norm(q)
    position, velocity, omega = rng.normal(size=(3, 3)).tolist()
    chassis = BodyState(tuple(position), Quaternion(*q.tolist()), tuple(velocity), tuple(omega))
    return drone, p, assembled_state(p, chassis, tuple(rng.uniform(-3, 3, 4)), tuple(speeds)), wrench, speeds, drive


def general(drone, x, wrench, speeds, drive, driven, feedback=0.0):
    """Solve with the general engine; a motor torque acts on propeller and chassis. `feedback`: Baumgarte's [1/s]."""
    q, v = arrays(x)
    if driven == "speed":
        system, imposed = drone_system(drone), np.stack([speeds, drive], axis=1)
        return system, accelerations(system, q, v, wrench, imposed), imposed
    system, wrench = drone_system(drone, (False,) * 4), wrench.copy()
    for k in range(4):
        # the motor's axis is the propeller's own z; seen from the chassis it is z as long as the hinge holds
        wrench[k + 1, 5] += drive[k]
        R0, R = (rotation(q[b, 3:]) for b in (0, k + 1))
        wrench[0, 3:] -= drive[k] * R0.T @ R[:, 2]
    none = np.zeros((0, 2))
    result, _ = augmented.solve(
        system.arrays, q, v, wrench, none, 2.0 * feedback, feedback * feedback, augmented.RANK_TOLERANCE, augmented.ANY
    )
    return system, result, None


def rotation(q):
    from lapwing.dynamics.lie import quaternion

    return np.array(quaternion.rotation_matrix(tuple(q))).reshape(3, 3)


@pytest.mark.parametrize("driven", ["speed", "torque"])
def test_identical_to_general_path(driven):
    rng = np.random.default_rng(31)
    for _ in range(20):
        drone, p, x, wrench, speeds, drive = scene(rng, driven)
        _, expected, _ = general(drone, x, wrench, speeds, drive, driven)
        _, ours = arrays(rate(p, 0.0, x))
        scale = np.abs(expected.acceleration).max()
        np.testing.assert_allclose(ours / scale, expected.acceleration / scale, atol=1e-12)


@pytest.mark.parametrize("feedback", [0.0, 50.0])
def test_identical_off_constraints_too(feedback):
    """Index-1 equations and their feedback also hold after drift, with hinges apart by 1 %."""
    rng = np.random.default_rng(32)
    for _ in range(20):
        drone, p, x, wrench, speeds, drive = scene(rng, "torque")
        q, v = arrays(x)
        q, v = add_increment(q, 0.01 * rng.normal(size=(5, 6))), v + 0.01 * rng.normal(size=(5, 6))
        bodies = [
            BodyState(tuple(a[:3]), Quaternion(*a[3:]), tuple(b[:3]), tuple(b[3:]))
            for a, b in zip(q.tolist(), v.tolist(), strict=True)
        ]
        x = FiveBodies(bodies[0], tuple(bodies[1:]))
        _, expected, _ = general(drone, x, wrench, speeds, drive, "torque", feedback)
        _, ours = arrays(rate(p._replace(feedback=feedback), 0.0, x))
        scale = np.abs(expected.acceleration).max()
        np.testing.assert_allclose(ours / scale, expected.acceleration / scale, atol=1e-12)


def test_reactions_are_multipliers():
    drone, p, x, wrench, speeds, drive = scene(np.random.default_rng(33), "speed")
    system, solution, imposed = general(drone, x, wrench, speeds, drive, "speed")
    expected = reactions(system, *arrays(x), solution, imposed)
    for k, (force, torque) in enumerate(from_chassis(p, 0.0, x)):
        np.testing.assert_allclose(force, expected[f"hinge {k + 1}"].force_world, atol=1e-10)
        np.testing.assert_allclose(torque, expected[f"hinge {k + 1}"].torque_world, atol=1e-10)


@pytest.mark.parametrize("driven", ["speed", "torque"])
def test_torn_off_propeller_equals_general_engine(driven):
    """The mechanism of three propellers and the free fourth one continue without forces between them."""
    rng = np.random.default_rng(34)
    for _ in range(10):
        drone, p, x, wrench, speeds, drive = scene(rng, driven)
        drive[1] = 0.0
        rotors = list(p.rotors)
        rotors[1] = rotors[1]._replace(drive=0.0, held=without_propeller(drone, 1).held[1])
        p = p._replace(rotors=tuple(rotors))
        system, wrench = drone_system(drone, (driven == "speed",) * 4).without("hinge 2"), wrench.copy()
        imposed = np.zeros((0, 2))
        if driven == "speed":
            system = system.without("drive 2")
            imposed = np.delete(np.stack([speeds, drive], axis=1), 1, 0)
        else:
            wrench[1:, 5] += drive
            wrench[0, 5] -= drive.sum()
        expected = accelerations(system, *arrays(x), wrench, imposed).acceleration
        _, ours = arrays(rate(p, 0.0, x))
        scale = np.abs(expected).max()
        np.testing.assert_allclose(ours / scale, expected / scale, atol=1e-12)
        assert from_chassis(p, 0.0, x)[1] == ((0.0,) * 3, (0.0,) * 3)
