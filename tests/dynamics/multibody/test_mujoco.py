"""The drone against MuJoCo (optional extra `bench`): accelerations at random states, and a tumbling flight."""

import numpy as np
import pytest
from test_augmented import PAPER
from test_delivery_drone import state

from lapwing.dynamics.integrators import get, integrate_fixed
from lapwing.dynamics.lie import quaternion
from lapwing.dynamics.multibody.delivery_drone import DroneState, Flight, Loads, delivery_drone, solve

try:
    import mujoco
except ImportError as error:
    pytest.skip(f"mujoco is not installed ({error}): pip install 'lapwing[bench]'", allow_module_level=True)

GRAVITY = (0.0, 0.0, -9.81)


def model(drone, step):
    """Return the five bodies in MuJoCo: a free joint and four hinges, no damping, no contact."""
    propellers = "".join(
        f'<body pos="{x} {y} {z}"><joint type="hinge" axis="0 0 1"/>'
        f'<inertial pos="0 0 0" mass="{drone.propeller_mass[k]}" diaginertia="{i[0]} {i[1]} {i[2]}"/></body>'
        for k, ((x, y, z), i) in enumerate(zip(drone.hubs, drone.propeller_inertia, strict=True))
    )
    a, b, c = drone.inertia
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{step}" integrator="RK4" gravity="0 0 -9.81"/><worldbody><body><freejoint/>'
        f'<inertial pos="0 0 0" mass="{drone.mass}" diaginertia="{a} {b} {c}"/>{propellers}</body></worldbody></mujoco>'
    )


def put(data, x):
    data.qpos[:] = [*x.position_world, *x.attitude, *x.angles]
    data.qvel[:] = [*x.velocity_world, *x.omega_body, *x.speeds]


def test_accelerations_at_100_random_states():
    rng = np.random.default_rng(61)
    drone = delivery_drone(**PAPER)
    m = model(drone, 1e-3)
    data = mujoco.MjData(m)
    for _ in range(100):
        x = state(rng)
        loads = Loads(*(tuple(rng.normal(size=n).tolist()) for n in (3, 3, 4, 4, 4)), GRAVITY)
        put(data, x)
        R = np.array(quaternion.rotation_matrix(x.attitude)).reshape(3, 3)
        data.xfrc_applied[1] = [*loads.force_world, *(R @ loads.torque_body)]
        for k in range(4):
            data.xfrc_applied[2 + k] = [*(loads.thrust[k] * R[:, 2]), *(loads.aerodynamic_torque[k] * R[:, 2])]
        data.qfrc_applied[6:] = loads.drive
        mujoco.mj_forward(m, data)
        ours = solve(drone, loads, x)
        ours = np.hstack([ours.acceleration_world, ours.angular_acceleration_body, ours.spin_acceleration])
        scale = np.abs(data.qacc).max()
        np.testing.assert_allclose(ours / scale, data.qacc / scale, atol=1e-9)
        for block in (slice(0, 3), slice(3, 6), slice(6, 10)):
            assert np.abs(ours[block] - data.qacc[block]).max() < 1e-9 * np.abs(data.qacc[block]).max()


def test_five_seconds_of_tumbling():
    """Both use RK4 with equal steps and differ by at most the error of the step."""
    drone = delivery_drone(**PAPER)
    x = DroneState(
        (0.0, 0.0, 10.0),
        quaternion.NO_ROTATION,
        (1.0, -2.0, 3.0),
        (6.0, 8.0, -5.0),
        (0.0, 0.5, 1.0, 1.5),
        (200.0, -180.0, 190.0, -210.0),
    )
    loads = Loads((0.0,) * 3, (0.0,) * 3, (0.0,) * 4, (0.0,) * 4, (0.002, -0.001, 0.001, 0.0), GRAVITY)
    method, differences, ends = get("rkmk4").Method(), [], []
    for n in (2500, 5000, 10000):
        m = model(drone, 5.0 / n)
        data = mujoco.MjData(m)
        put(data, x)
        data.qfrc_applied[6:] = loads.drive
        for _ in range(n):
            mujoco.mj_step(m, data)
        ours = integrate_fixed(method, Flight(drone, loads), 0.0, x, 5.0 / n, n)
        ours = np.hstack(
            [ours.position_world, ours.attitude, ours.angles, ours.velocity_world, ours.omega_body, ours.speeds]
        )
        ends.append(ours)
        differences.append(np.abs(ours - np.hstack([data.qpos, data.qvel])).max())
    errors = [np.abs(end - ends[-1]).max() for end in ends[:-1]]
    assert errors[0] / errors[1] > 10.0, errors
    assert differences[0] < 3.0 * errors[0], (differences, errors)
    assert differences[-1] < 1e-6, differences
