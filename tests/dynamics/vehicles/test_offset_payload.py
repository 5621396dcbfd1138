"""Offset payload: parallel axes, momentum at the release, and a flight with a release."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import lapwing
from lapwing.dynamics import effects
from lapwing.dynamics.effects._types import body_of
from lapwing.dynamics.effects.payload_release import RELEASED
from lapwing.dynamics.integrators import get
from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.noise import stream_key
from lapwing.dynamics.validation import fault
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.airframe import Airframe, load_airframe
from lapwing.dynamics.vehicles.airframe_tables import CarriedBox
from lapwing.services.scene_resolver import load, resolve

DRONE = load_airframe(Path(__file__).parents[3] / "lapwing/scenes/vehicles/delivery_drone.toml")
BARE = DRONE.mass.model_copy(
    update={"total": 8.0, "payload": 0.0, "centre": (0.01, -0.02, 0.03), "products": (0.01, -0.005, 0.002)}
)
BOX = CarriedBox(mass=2.0, position=(0.12, 0.05, -0.20), size=(0.30, 0.20, 0.10))
FRAME = DRONE.model_copy(update={"mass": BARE, "payload": BOX})
RK4, KEY, STEP = get("rk4_renormalised").Method(), stream_key(1, "drone1", "effects"), 1e-3


def points_of(mass, inertia, centre):
    """Return six point masses (m, r) with this mass, centre and inertia matrix."""
    second = 0.5 * np.trace(inertia) * np.eye(3) - inertia  # integral of r r^T dm
    values, axes = np.linalg.eigh(second)
    arms = [sign * np.sqrt(3.0 * v / mass) * a for v, a in zip(values, axes.T, strict=True) for sign in (1, -1)]
    return [(mass / 6.0, centre + arm) for arm in arms]


def test_mass_centre_and_inertia_equal_point_masses():
    """The reference is a sum over point masses; the box is m (b^2 + c^2) / 12 by hand."""
    box = 2.0 / 12.0 * np.diag([0.2**2 + 0.1**2, 0.3**2 + 0.1**2, 0.3**2 + 0.2**2])
    points = points_of(8.0, BARE.matrix, np.array(BARE.centre)) + points_of(2.0, box, np.array(BOX.position))
    masses, places = np.array([m for m, _ in points]), np.array([r for _, r in points])
    centre = masses @ places / masses.sum()
    arms = places - centre
    inertia = sum(m * (a @ a * np.eye(3) - np.outer(a, a)) for m, a in zip(masses, arms, strict=True))
    joint = FRAME.loaded.mass
    assert joint.total == pytest.approx(masses.sum())
    assert joint.centre == pytest.approx(centre)
    assert joint.matrix == pytest.approx(inertia, abs=1e-12)
    loaded = FRAME.loaded
    assert loaded.loaded is loaded


def flying(tables):
    frame = FRAME.loaded.about_centre
    p = multirotor.parameters(frame, effects.from_scene(tables, frame))
    attitude = Quaternion(*map(float, Rotation.from_rotvec([0.2, -0.4, 0.3]).as_quat(scalar_first=True)))
    return p, multirotor.initial_state(p, (1.0, 2.0, 50.0), attitude, 0.0, (3.0, -1.0, 0.5), (2.0, -3.0, 1.0))


def released(state):
    return state._replace(memory=tuple(RELEASED if len(m) == 1 else m for m in state.memory))


def momenta(mass, inertia, centre, motion):
    """Return (linear, angular about the world's origin) momentum of a body with an offset centre of mass."""
    R = Rotation.from_quat(motion.attitude, scalar_first=True)
    omega = R.apply(motion.omega_body)
    arm = R.apply(centre)
    linear = mass * (motion.velocity_world + np.cross(omega, arm))
    own = R.apply(inertia @ motion.omega_body)
    return linear, np.cross(np.array(motion.position_world) + arm, linear) + own


@pytest.mark.long
def test_release_conserves_momentum_of_both():
    """In free space the vehicle's momentum is constant after the release; with the box's it equals the one before."""
    p, state = flying({"payload_release": {}})
    (effect,) = p.effects
    for tick in range(200):
        state = multirotor.advance(RK4, p, KEY, tick, state, (0.0,) * 4, STEP, 1)
    before = momenta(10.0, FRAME.loaded.mass.matrix, np.zeros(3), state.motion)
    box = momenta(2.0, BOX.inertia, np.subtract(BOX.position, FRAME.loaded.mass.centre), state.motion)
    empty = effect.empty
    matrix = np.reshape(empty.inertia, (3, 3))
    assert matrix == pytest.approx(BARE.matrix, abs=1e-12)
    assert empty.centre_body == pytest.approx(np.subtract(BARE.centre, FRAME.loaded.mass.centre))
    state = released(state)
    for tick in range(200, 700):
        state = multirotor.advance(RK4, p, KEY, tick, state, (0.0,) * 4, STEP, 1)
    after = momenta(8.0, matrix, np.array(empty.centre_body), state.motion)
    assert after[0] + box[0] == pytest.approx(before[0], abs=1e-9)
    assert after[1] + box[1] == pytest.approx(before[1], abs=1e-6)


@pytest.mark.long
def test_carried_payload_acts_as_part_of_body():
    p, state = flying({"payload_release": {}, "gravity": {}, "rotor_thrust": {}})
    plain, other = flying({"gravity": {}, "rotor_thrust": {}})
    m = FRAME.loaded.mass
    plain = plain._replace(body=body_of(m.total, m.inertia, m.products))
    for tick in range(100):
        state = multirotor.advance(RK4, p, KEY, tick, state, (30.0, 31.0, 32.0, 29.0), STEP, 1)
        other = multirotor.advance(RK4, plain, KEY, tick, other, (30.0, 31.0, 32.0, 29.0), STEP, 1)
    assert np.array(state.motion.position_world) == pytest.approx(other.motion.position_world, abs=1e-10)
    assert np.array(state.motion.omega_body) == pytest.approx(other.motion.omega_body, abs=1e-10)


@pytest.mark.long
def test_empty_vehicle_equals_airframe_without_box():
    """After the release the vehicle flies as the bare airframe with the state of its centre of mass."""
    tables = {"gravity": {}, "rotor_thrust": {}, "h_force": {"coefficient": 1e-4}, "gyroscopic_torque": {}}
    p, state = flying({**tables, "payload_release": {}})
    state = released(state)
    bare = DRONE.model_copy(update={"mass": BARE}).about_centre
    q = multirotor.parameters(bare, effects.from_scene(tables, bare))
    c = np.subtract(BARE.centre, FRAME.loaded.mass.centre)

    def at_centre(m):
        R = Rotation.from_quat(m.attitude, scalar_first=True)
        return m.position_world + R.apply(c), m.velocity_world + R.apply(np.cross(m.omega_body, c))

    position, velocity = (tuple(map(float, v)) for v in at_centre(state.motion))
    other = multirotor.initial_state(q, position, state.motion.attitude, 0.0, velocity, state.motion.omega_body)
    for tick in range(500):
        state = multirotor.advance(RK4, p, KEY, tick, state, (30.0, 31.0, 32.0, 29.0), STEP, 1)
        other = multirotor.advance(RK4, q, KEY, tick, other, (30.0, 31.0, 32.0, 29.0), STEP, 1)
    assert at_centre(state.motion)[0] == pytest.approx(np.array(other.motion.position_world), abs=1e-8)
    assert at_centre(state.motion)[1] == pytest.approx(np.array(other.motion.velocity_world), abs=1e-7)
    assert np.array(state.motion.omega_body) == pytest.approx(np.array(other.motion.omega_body), abs=1e-7)


@pytest.mark.long
def test_flight_releases_payload_ahead_of_centre():
    """The front rotors carry more with the payload; after the release thrusts balance about the vehicle's centre."""
    ahead, arm, g = 0.1, 0.35171491, 9.80665
    box = {"mass": 2.0, "position": [ahead, 0.0, -0.1], "size": [0.2, 0.13, 0.23]}
    flight = lapwing.fly(
        "hover",
        {"airframe.mass.total": 8.0224, "airframe.mass.payload": 0.0, "airframe.payload": box,
         "effects.payload_release.release_time": 5.0, "run.duration": 20.0,
         "trajectory.phase": [
             {"name": "climb", "z": {"kind": "minimum_jerk", "to": 2.0, "duration": 3.0}},
             {"name": "hover", "duration": 9.0},
             {"name": "descend", "z": {"kind": "minimum_jerk", "to": 0.0, "duration": 3.0}},
             {"name": "land", "duration": 2.0},
         ]},
    )  # fmt: skip
    assert flight.landed
    t, thrust = flight.truth.times, flight.truth.rotor_thrust
    with_it, without = thrust[(t > 4.5) & (t < 5.0)].mean(axis=0), thrust[(t > 11.0) & (t < 12.0)].mean(axis=0)
    signs = np.array([1.0, -1.0, -1.0, 1.0])  # front left, rear left, rear right, front right
    c = 2.0 * ahead / 10.0224
    assert with_it == pytest.approx(0.25 * 10.0224 * g * (1.0 + signs * c / arm), rel=5e-3)
    assert without == pytest.approx(np.full(4, 0.25 * 8.0224 * g), rel=1e-2)


@pytest.mark.long
def test_batch_release_is_bit_for_bit_identical():
    box = {"mass": 2.0, "position": [0.1, 0.0, -0.1], "size": [0.2, 0.13, 0.23]}
    scene = load(
        "hover",
        {"airframe.mass.total": 8.0224, "airframe.mass.payload": 0.0, "airframe.payload": box,
         "effects.payload_release.release_time": 0.1},
    )  # fmt: skip
    batch = lapwing.BatchSimulator(scene, 2)
    for _ in range(50):
        result = batch.step(motor_voltages=np.full((2, 4), 36.0))
    core, state = resolve(scene).services["plant"].parameters.core, resolve(scene).services["plant"].parameters.start
    x = state.vehicle
    for tick in range(50):
        x = multirotor.advance(core.method, core.vehicle, core.key, tick, x, (36.0,) * 4, core.step, core.steps)
    assert result.position_world[1].tolist() == list(x.motion.position_world)
    assert result.omega_body[1].tolist() == list(x.motion.omega_body)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"vehicle.mass": 9.0}, r"vehicle\.mass: conflicts with airframe\.payload"),
        ({"vehicle.model": "multibody"}, "payload: the five-body model does not support it"),
    ],
)
def test_invalid_scene_payload_is_rejected(overrides, message):
    box = {"mass": 2.0, "position": [0.1, 0.0, -0.1], "size": [0.2, 0.13, 0.23]}
    with pytest.raises(ValueError, match=message):
        resolve(load("hover", {"airframe.mass.payload": 0.0, "airframe.payload": box, **overrides}))


@pytest.mark.parametrize(
    ("mass", "payload", "table", "message"),
    [
        ({"payload": 1.0}, {}, {}, "mass.payload: expected 0, got 1 together with a table"),
        ({}, {"mass": -1.0}, {}, "payload.mass: expected a number above 0 [kg], got -1.0"),
        (
            {},
            {},
            {"mass": 1.0},
            "effects.payload_release.mass: set together with airframe.payload; expected one of them",
        ),
        ({}, {}, {"size": [1.0, 1.0, 1.0]}, "effects.payload_release.size: set together with airframe.payload"),
    ],
)
def test_invalid_payload_is_rejected(tmp_path, mass, payload, table, message):
    whole = FRAME.model_dump(exclude_none=True)
    whole["mass"] |= mass
    whole["payload"] |= payload
    with pytest.raises(ValueError) as caught:
        effects.from_scene({"payload_release": table}, Airframe.model_validate(whole).loaded.about_centre)
    error = caught.value
    text = str(fault(error, Airframe) if hasattr(error, "errors") else error)
    assert text.startswith(message)
