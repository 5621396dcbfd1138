"""Products of inertia and an offset centre of mass against the same body in other axes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import lapwing
from lapwing.dynamics import effects
from lapwing.dynamics.effects._types import FullMassProperties, body_of
from lapwing.dynamics.integrators import get
from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.noise import stream_key
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.airframe import Airframe, load_airframe
from lapwing.dynamics.vehicles.airframe_tables import Mass
from lapwing.services.common.schemas.run_schema import SHIPPED

DRONE = load_airframe(SHIPPED / "vehicles/delivery_drone.toml")
RK4 = get("rk4_renormalised").Method()
KEY = stream_key(1, "drone1", "effects")
TURN = Rotation.from_euler("zyx", [0.4, -0.3, 0.7])  # from the principal axes to the body's
PRINCIPAL = np.diag(DRONE.mass.inertia)
MATRIX = TURN.as_matrix() @ PRINCIPAL @ TURN.as_matrix().T
PRODUCTS = (MATRIX[0, 1], MATRIX[0, 2], MATRIX[1, 2])


def tumbled(inertia, products, attitude, omega):
    mass = DRONE.mass.model_copy(update={"inertia": tuple(inertia), "products": tuple(products)})
    frame = DRONE.model_copy(update={"mass": mass})
    p = multirotor.parameters(frame, effects.from_scene({"gravity": {}, "rotor_thrust": {}}, frame))
    q = Quaternion(*np.roll(attitude.as_quat(), 1).tolist())
    state = multirotor.initial_state(p, (0.0, 0.0, 50.0), q, 0.0, (0.0, 0.0, 0.0), tuple(map(float, omega)))
    m = multirotor.advance(RK4, p, KEY, 0, state, (0.0,) * 4, 1e-3, 1500).motion
    return Rotation.from_quat(np.roll(m.attitude, -1)), np.array(m.omega_body)


@pytest.mark.long
def test_tumbling_is_independent_of_body_axes():
    omega = np.array([3.0, 0.2, -1.0])
    attitude, rate = tumbled(np.diag(PRINCIPAL), (0.0, 0.0, 0.0), Rotation.identity(), omega)
    turned, turned_rate = tumbled(np.diag(MATRIX), PRODUCTS, TURN.inv(), TURN.apply(omega))
    assert (turned.inv() * attitude * TURN.inv()).magnitude() < 1e-9
    assert turned_rate == pytest.approx(TURN.apply(rate), abs=1e-9)


def test_inverse_inertia_with_and_without_products():
    full = body_of(2.0, tuple(np.diag(MATRIX)), PRODUCTS)
    product = np.reshape(full.inertia, (3, 3)) @ np.reshape(full.inverse_inertia, (3, 3))
    assert product == pytest.approx(np.eye(3), abs=1e-12)
    assert not isinstance(body_of(2.0, DRONE.mass.inertia), FullMassProperties)


@pytest.mark.parametrize(
    ("products", "message"),
    [((0.4, 0.0, 0.0), "products: .* principal moment"), ((0.0, 0.0, 0.15), "triangle inequality")],
)
def test_impossible_inertia_matrix_is_rejected(products, message):
    with pytest.raises(ValueError, match=message):
        Mass(total=1.0, payload=0.0, inertia=(0.27, 0.26, 0.42), products=products)


def test_positions_are_moved_to_centre_of_mass_once():
    mass = DRONE.mass.model_copy(update={"centre": (0.017, 0.0, -0.01)})
    moved = DRONE.model_copy(update={"mass": mass}).about_centre
    assert moved.rotors.position[0] == pytest.approx((0.35171491 - 0.017, 0.35171491, 0.01))
    assert moved.contact.feet[1] == pytest.approx((-0.217, 0.25, -0.34))
    assert moved.about_centre is moved
    assert DRONE.about_centre is DRONE
    assert isinstance(moved, Airframe)


@pytest.mark.long
def test_hover_thrusts_balance_offset_centre_of_mass():
    """The smallest thrusts without torque are F = W / 4 (1 + (c . r) / l^2), r from the hubs' centre."""
    c, arm = 0.017, 0.35171491
    flight = lapwing.fly("hover", {"airframe.mass.centre": [c, 0.0, 0.0], "run.duration": 5.5})
    thrust = flight.truth.rotor_thrust[flight.truth.times > 5.0].mean(axis=0)
    weight = DRONE.mass.total * 9.80665
    tilted = [1.0 + sign * c / arm for sign in (1.0, -1.0, -1.0, 1.0)]
    assert thrust == pytest.approx(0.25 * weight * np.array(tilted), rel=2e-3)
    assert abs(flight.truth.position[flight.truth.times > 5.0, 0]).max() < 0.01
