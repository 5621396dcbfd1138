"""Drone in minimal coordinates against its five bodies and momentum theorems; invalid numbers."""

import math

import numpy as np
import pytest
from test_augmented import PAPER

from lapwing.dynamics.integrators import get, integrate_fixed
from lapwing.dynamics.lie import quaternion
from lapwing.dynamics.multibody.delivery_drone import DroneState, Flight, Loads, delivery_drone, solve
from lapwing.dynamics.multibody.five_bodies import BodyState, Wrench, arrays, machine, rate
from lapwing.dynamics.multibody.five_body_stabilisation import assembled_state

ZERO4 = (0.0, 0.0, 0.0, 0.0)
GRAVITY = (0.0, 0.0, -9.81)
QUIET = Loads((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), ZERO4, ZERO4, ZERO4, (0.0, 0.0, 0.0))


def state(rng):
    q = rng.normal(size=4)
    rows = rng.normal(size=(3, 3)).tolist()
    return DroneState(
        tuple(rows[0]), quaternion.Quaternion(*(q / np.linalg.norm(q)).tolist()), tuple(rows[1]), tuple(rows[2]),
        tuple(rng.uniform(-3, 3, 4).tolist()), tuple(rng.uniform(-400, 400, 4).tolist()),
    )  # fmt: skip


def loads(rng):
    return Loads(*(tuple(rng.normal(size=n).tolist()) for n in (3, 3, 4, 4, 4)), GRAVITY)


@pytest.mark.long
@pytest.mark.parametrize("driven", ["torque", "speed"])
def test_minimal_coordinates_equal_five_bodies(driven):
    rng = np.random.default_rng(51)
    drone = delivery_drone(**PAPER, driven=driven)
    for _ in range(20):
        x, values = state(rng), loads(rng)
        R = np.array(quaternion.rotation_matrix(x.attitude)).reshape(3, 3)
        thrusts = [
            Wrench(tuple((values.thrust[k] * R[:, 2]).tolist()), (0.0, 0.0, values.aerodynamic_torque[k]))
            for k in range(4)
        ]
        wrenches = (Wrench(values.force_world, values.torque_body), *thrusts)
        p = machine(drone, GRAVITY, values.drive, x.speeds, wrenches)
        five = assembled_state(p, BodyState(*x[:4]), x.angles, x.speeds)
        _, expected = arrays(rate(p, 0.0, five))
        ours = solve(drone, values, x)
        scale = np.abs(expected).max()
        np.testing.assert_allclose(np.array(ours.acceleration_world) / scale, expected[0, :3] / scale, atol=1e-12)
        np.testing.assert_allclose(
            np.array(ours.angular_acceleration_body) / scale, expected[0, 3:] / scale, atol=1e-12
        )
        spin = expected[1:, 5] - ours.angular_acceleration_body[2]  # z of the propeller is z of the chassis
        np.testing.assert_allclose(np.array(ours.spin_acceleration) / scale, spin / scale, atol=1e-12)
        if driven == "torque":
            np.testing.assert_allclose(ours.drive_torque, values.drive, atol=1e-12)


def test_imposed_speed_and_drive_torque_are_inverse():
    """Applying the drive torque of an imposed acceleration produces that acceleration."""
    rng = np.random.default_rng(52)
    x, values = state(rng), loads(rng)
    imposed = solve(delivery_drone(**PAPER, driven="speed"), values, x)
    assert imposed.spin_acceleration == values.drive
    back = solve(delivery_drone(**PAPER), values._replace(drive=imposed.drive_torque), x)
    np.testing.assert_allclose(back.spin_acceleration, values.drive, rtol=1e-11)
    np.testing.assert_allclose(back.angular_acceleration_body, imposed.angular_acceleration_body, rtol=1e-11)


def momentum(drone, x):
    """Return the angular momentum about the common centre of mass, that of the chassis, in the world."""
    R = np.array(quaternion.rotation_matrix(x.attitude)).reshape(3, 3)
    w = np.array(x.omega_body)
    L = np.array(drone.inertia) * w
    for k in range(4):
        c, s = math.cos(x.angles[k]), math.sin(x.angles[k])
        C = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        hub = np.array(drone.hubs[k])
        L += C @ np.diag(drone.propeller_inertia[k]) @ C.T @ (w + np.array([0, 0, x.speeds[k]]))
        L += drone.propeller_mass[k] * np.cross(hub, np.cross(w, hub))
    return R @ L


def test_free_flight_keeps_angular_momentum_under_motors():
    drone = delivery_drone(**PAPER)
    x = state(np.random.default_rng(53))
    motors = QUIET._replace(drive=(0.02, -0.01, 0.005, 0.01))
    end = integrate_fixed(get("rkmk4").Method(), Flight(drone, motors), 0.0, x, 1e-4, 5000)
    np.testing.assert_allclose(momentum(drone, end), momentum(drone, x), atol=1e-7)
    np.testing.assert_allclose(end.velocity_world, x.velocity_world, atol=1e-12)


def test_hover():
    """Thrust equal to weight and counter-rotating pairs move nothing; hinges carry thrust less weight."""
    drone = delivery_drone(**PAPER)
    mass = drone.mass + sum(drone.propeller_mass)
    x = DroneState((0.0,) * 3, quaternion.NO_ROTATION, (0.0,) * 3, (0.0,) * 3, ZERO4, (300.0, -300.0, 300.0, -300.0))
    drag = (-0.4, 0.4, -0.4, 0.4)
    hover = QUIET._replace(
        thrust=(9.81 * mass / 4,) * 4, aerodynamic_torque=drag, drive=tuple(-d for d in drag), gravity_world=GRAVITY
    )
    m = solve(drone, hover, x)
    for values in (m.acceleration_world, m.angular_acceleration_body, m.spin_acceleration):
        np.testing.assert_allclose(values, 0.0, atol=1e-12)
    np.testing.assert_allclose([f[2] for f in m.reaction_force_body], -9.81 * drone.mass / 4, atol=1e-12)


def without_propeller(drone, k):
    """Return the drone after propeller k (0 to 3) was torn off; the state ignores its angle and speed."""
    return drone._replace(held=tuple(0.0 if i == k else held for i, held in enumerate(drone.held)))


def test_detached_propeller_is_removed():
    """Only its mass, thrust and torque are absent: the remaining bodies accelerate about the shifted centre of mass."""
    rng = np.random.default_rng(54)
    drone = without_propeller(delivery_drone(**PAPER), 2)
    x, values = state(rng), loads(rng)
    m = solve(drone, values, x)
    assert m.reaction_force_body[2] == (0.0, 0.0, 0.0)
    assert np.all(np.isfinite(np.hstack([np.ravel(v) for v in m])))
    # total force = sum of masses times accelerations
    hub, w, alpha = np.array(drone.hubs), np.array(x.omega_body), np.array(m.angular_acceleration_body)
    R = np.array(quaternion.rotation_matrix(x.attitude)).reshape(3, 3)
    total = drone.mass * np.array(m.acceleration_world)
    for k in (0, 1, 3):
        relative = np.cross(alpha, hub[k]) + np.cross(w, np.cross(w, hub[k]))
        total += drone.propeller_mass[k] * (np.array(m.acceleration_world) + R @ relative)
    mass = drone.mass + sum(drone.propeller_mass[k] for k in (0, 1, 3))
    thrust = sum(values.thrust[k] for k in (0, 1, 3))
    np.testing.assert_allclose(
        total, np.array(values.force_world) + thrust * R[:, 2] + mass * np.array(GRAVITY), atol=1e-10
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"propeller": -1.0}, "propeller must be positive"),
        ({"frame_inertia": (0.27, 0.0, 0.42)}, "frame_inertia must be positive"),
        ({"payload": -1.0}, "payload must not be negative"),
        ({"driven": "belt"}, "unknown drive 'belt': choose one of torque, speed"),
        ({"rotor_sign_x": (1, -1, 0, 1)}, r"must contain \+1 or -1"),
    ],
)
def test_invalid_numbers_are_rejected(change, message):
    with pytest.raises(ValueError, match=message):
        delivery_drone(**{**PAPER, **change})
