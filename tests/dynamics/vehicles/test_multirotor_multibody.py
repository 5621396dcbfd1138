"""Five bodies under the effects of a scene: with symmetric propellers they are the reduced model, else they wobble."""

from pathlib import Path

import numpy as np
import pytest

from dynamics import effects
from dynamics.effects._types import body_of
from dynamics.integrators import get
from dynamics.kernel import kernel
from dynamics.lie.quaternion import exp, rotation_matrix
from dynamics.noise import stream_key
from dynamics.vehicles import multirotor, multirotor_multibody
from dynamics.vehicles.airframe import load_airframe

DRONE = load_airframe(Path(__file__).parents[3] / "scenes/vehicles/delivery_drone.toml")
RK4 = get("rk4_renormalised").Method()
KEY = stream_key(1, "drone1", "effects")
ACTIVE = effects.from_scene({"gravity": {}, "rotor_thrust": {}, "rotor_gyro": {}, "body_drag": {}}, DRONE)
VOLTS = (31.0, 33.0, 30.0, 34.0)
SPEED = 320.0


def with_blades(along, across):
    return DRONE.model_copy(update={"rotors": DRONE.rotors.model_copy(update={"blade_inertia": (along, across)})})


SYMMETRIC = with_blades(4.349e-4, 4.349e-4)


def reduced():
    """One rigid body with the mean inertia of all five."""
    p = multirotor.parameters(SYMMETRIC, ACTIVE)
    rotors, inertia = DRONE.rotors, np.array(DRONE.mass.inertia)
    for hub in np.array(rotors.position):
        inertia += rotors.mass * (hub @ hub - hub * hub) + [4.349e-4, 4.349e-4, rotors.inertia]
    # the rotor's axial inertia turns with the body too; the spin is `rotor_gyro`'s
    return p._replace(body=body_of(DRONE.mass.total, tuple(inertia.tolist())))


def thrown(state, omega):
    """Turning at omega, each form in its own way."""
    if hasattr(state.motion, "omega_body"):
        return state._replace(motion=state.motion._replace(omega_body=omega))
    chassis = state.motion.chassis
    w = np.array(omega)
    R = np.array(rotation_matrix(chassis.attitude)).reshape(3, 3)
    propellers = []
    for body in state.motion.propellers:
        arm = R.T @ (np.array(body.position_world) - chassis.position_world)
        velocity = R @ np.cross(w, arm)
        spin = tuple((w + body.omega_body).tolist())  # blades along x: the frames agree
        propellers.append(body._replace(velocity_world=tuple(velocity.tolist()), omega_body=spin))
    return state._replace(
        motion=state.motion._replace(chassis=chassis._replace(omega_body=omega), propellers=tuple(propellers))
    )


@kernel
def looked(p, x):
    return multirotor.seen(p.layout, x)


def fly(p, state, seconds, h):
    return multirotor.advance(RK4, p, KEY, 0, state, VOLTS, h, round(seconds / h))


OMEGA = (0.6, -0.4, 0.3)
ATTITUDE = exp((0.1, -0.2, 0.3))


@pytest.fixture(scope="module")
def reference():
    p = reduced()
    return fly(p, thrown(multirotor.initial_state(p, (0.0, 0.0, 10.0), ATTITUDE, SPEED), OMEGA), 0.2, 2.5e-4).motion


@pytest.mark.parametrize("stabilisation", ["projection", "partitioning", "baumgarte", "none"])
def test_symmetric_propellers_at_imposed_speed_are_the_reduced_model(reference, stabilisation):
    p = multirotor_multibody.parameters(SYMMETRIC, ACTIVE, "speed", stabilisation)
    start = thrown(multirotor_multibody.initial_state(p, (0.0, 0.0, 10.0), ATTITUDE, SPEED), OMEGA)
    ours = looked(p, fly(p, start, 0.2, 2.5e-4).motion)
    for name in reference._fields:
        np.testing.assert_allclose(getattr(ours, name), getattr(reference, name), rtol=1e-7, atol=2e-8, err_msg=name)
