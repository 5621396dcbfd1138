"""Five bodies with effects: symmetric propellers reproduce the reduced model, uneven ones wobble."""

import math
from pathlib import Path

import numpy as np
import pytest

from lapwing.dynamics import effects
from lapwing.dynamics.effects._types import body_of
from lapwing.dynamics.integrators import get
from lapwing.dynamics.lie.quaternion import NO_ROTATION, exp
from lapwing.dynamics.noise import stream_key
from lapwing.dynamics.vehicles import multirotor, multirotor_equations, multirotor_multibody
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.dynamics.vehicles.multirotor_equations import StepInputs
from lapwing.dynamics.vehicles.multirotor_multibody_equations import joints
from lapwing.kernels import kernel
from tests.combinations import rest_nightly

DRONE = load_airframe(Path(__file__).parents[3] / "lapwing/scenes/vehicles/delivery_drone.toml")
RK4 = get("rk4_renormalised").Method()
KEY = stream_key(1, "drone1", "effects")
ACTIVE = effects.from_scene({"gravity": {}, "rotor_thrust": {}, "gyroscopic_torque": {}, "body_drag": {}}, DRONE)
VOLTS = (31.0, 33.0, 30.0, 34.0)
SPEED = 320.0


def with_blades(along, across):
    return DRONE.model_copy(update={"rotors": DRONE.rotors.model_copy(update={"blade_inertia": (along, across)})})


SYMMETRIC = with_blades(4.349e-4, 4.349e-4)


def reduced():
    """Return one rigid body with the mean inertia of all five."""
    p = multirotor.parameters(SYMMETRIC, ACTIVE)
    rotors, inertia = DRONE.rotors, np.array(DRONE.mass.inertia)
    for hub in np.array(rotors.position):
        inertia += rotors.mass * (hub @ hub - hub * hub) + [4.349e-4, 4.349e-4, rotors.inertia]
    # the rotor's axial inertia turns with the body too; the spin is `gyroscopic_torque`'s
    return p._replace(body=body_of(DRONE.mass.total, tuple(inertia.tolist())))


@kernel
def looked(p, x):
    return multirotor_equations.motion_of(p.layout, x)


def fly(p, state, seconds, h):
    return multirotor.advance(RK4, p, KEY, 0, state, VOLTS, h, round(seconds / h))


OMEGA = (0.6, -0.4, 0.3)
ATTITUDE = exp((0.1, -0.2, 0.3))


@pytest.fixture(scope="module")
def reference():
    p = reduced()
    return fly(p, multirotor.initial_state(p, (0.0, 0.0, 10.0), ATTITUDE, SPEED, omega_body=OMEGA), 0.2, 2.5e-4).motion


@pytest.mark.long
@pytest.mark.parametrize("stabilisation", rest_nightly("projection", "partitioning", "baumgarte", "none"))
def test_symmetric_propellers_at_imposed_speed_equal_reduced_model(reference, stabilisation):
    p = multirotor_multibody.parameters(SYMMETRIC, ACTIVE, "speed", stabilisation)
    start = multirotor_multibody.initial_state(p, (0.0, 0.0, 10.0), ATTITUDE, SPEED, omega_body=OMEGA)
    # feedback converts drift of the integration into motion of the chassis: half the step for the same error
    ours = looked(p, fly(p, start, 0.2, 1.25e-4 if stabilisation == "baumgarte" else 2.5e-4).motion)
    for name in reference._fields:
        np.testing.assert_allclose(getattr(ours, name), getattr(reference, name), rtol=1e-7, atol=2e-8, err_msg=name)


def hovering(blades, drive, omega=(0.0, 0.0, 0.0)):
    """Return (parameters, state with rate omega, voltages that hold the rotors at SPEED)."""
    p = multirotor_multibody.parameters(blades, ACTIVE, drive)
    state = multirotor_multibody.initial_state(p, (0.0, 0.0, 10.0), NO_ROTATION, SPEED, omega_body=omega)
    return p, state, (SPEED * DRONE.motor.rotor_constant,) * 4


@pytest.mark.long
def test_uneven_propellers_wobble_at_twice_their_speed():
    """In rotation about x the momentum about x is constant: w (I + 4 half cos 2 phi) = constant (eq. (8.50))."""
    p, state, volts = hovering(DRONE, "speed", (0.5, 0.0, 0.0))
    along, across = DRONE.rotors.blade_inertia
    hubs = np.array(DRONE.rotors.position)
    mean = DRONE.mass.inertia[0] + 2.0 * (along + across) + DRONE.rotors.mass * (hubs[:, 1] ** 2).sum()
    swing = 2.0 * (along - across)
    h, n = 2.5e-4, 4
    for i in range(1, 40):
        state = multirotor.advance(RK4, p, KEY, i - 1, state, volts, h, n)
        expected = 0.5 * (mean + swing) / (mean + swing * math.cos(2.0 * SPEED * i * n * h))
        assert looked(p, state.motion).omega_body == pytest.approx((expected, 0.0, 0.0), abs=1e-6)
    assert abs(2.0 * swing / mean) > 5e-3  # the wobble, absent in the reduced model, relative to its rate


@kernel
def hinges(p, state, volts):
    return joints(StepInputs(p, p.body, state.memory, volts), 0.0, state.motion)


@pytest.mark.long
@pytest.mark.parametrize("drive", ["torque", "speed"])
def test_hinges_carry_thrust_and_drives_hold_drag(drive):
    p, state, volts = hovering(DRONE, drive)
    seen = multirotor.observe(p, 0, 0.004, state, volts)
    up = sum(seen.thrust) / DRONE.mass.total - 9.80665
    assert seen.acceleration_world == pytest.approx((0.0, 0.0, up), abs=1e-11)
    chassis, *propellers = hinges(p, state, volts)
    for k, (force, torque) in enumerate(propellers):
        carried = DRONE.rotors.mass * (9.80665 + up) - seen.thrust[k]
        assert force == pytest.approx((0.0, 0.0, carried), abs=1e-11)
        assert torque == pytest.approx((0.0, 0.0, -DRONE.rotors.reaction_sign[k] * seen.torque[k]), abs=1e-11)
    assert chassis[0][2] == pytest.approx(-sum(force[2] for force, _ in propellers))
    assert chassis[1] == pytest.approx((0.0, 0.0, 0.0), abs=1e-10)


def test_single_rotor_must_be_described():
    bare = DRONE.model_copy(update={"rotors": DRONE.rotors.model_copy(update={"mass": None})})
    with pytest.raises(ValueError, match="rotors: the five-body model needs four rotors with mass and blade_inertia"):
        multirotor_multibody.parameters(bare)
