"""Plant without effects against closed forms and an independent implementation."""

import math
from pathlib import Path

import numba
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from lapwing.dynamics import effects
from lapwing.dynamics.effects._stiff_effects import only_stiff_sleep
from lapwing.dynamics.integrators import get
from lapwing.dynamics.lie.quaternion import NO_ROTATION, Quaternion
from lapwing.dynamics.noise import stream_key
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.dynamics.vehicles.multirotor_equations import STANDARD_DENSITY

DRONE = load_airframe(Path(__file__).parents[3] / "lapwing/scenes/vehicles/delivery_drone.toml")
RK4 = get("rk4_renormalised").Method()
KEY = stream_key(1, "drone1", "effects")
BARE = multirotor.parameters(DRONE, effects.from_scene({"gravity": {}, "rotor_thrust": {}}, DRONE))
G = 9.80665
WEIGHT = DRONE.mass.total * G
HOVER_SPEED = math.sqrt(WEIGHT / 4 / (BARE.effects[1].thrust_constant * STANDARD_DENSITY))
HOVER_VOLTAGE = HOVER_SPEED / BARE.layout.speed_per_volt


def fly(state, voltage, seconds, h=1e-3, p=BARE):
    return multirotor.advance(RK4, p, KEY, 0, state, tuple(voltage), h, round(seconds / h))


def start(omega=(0.0, 0.0, 0.0), attitude=NO_ROTATION, speed=0.0, p=BARE):
    state = multirotor.initial_state(p, (0.0, 0.0, 10.0), attitude, speed)
    return state._replace(motion=state.motion._replace(omega_body=omega))


def test_falls_freely_with_rotors_at_rest():
    m = fly(start(), (0.0,) * 4, 1.0).motion
    assert m.position_world == pytest.approx((0.0, 0.0, 10.0 - G / 2), abs=1e-12)
    assert m.velocity_world == pytest.approx((0.0, 0.0, -G), abs=1e-12)
    assert m.rotor_speed == (0.0,) * 4


def test_hovers_where_thrust_equals_weight():
    state = start(speed=HOVER_SPEED)
    m = fly(state, (HOVER_VOLTAGE,) * 4, 2.0).motion
    assert m.position_world == pytest.approx((0.0, 0.0, 10.0), abs=1e-10)
    o = multirotor.observe(BARE, 0, 0.004, state, (HOVER_VOLTAGE,) * 4)
    assert sum(o.thrust) == pytest.approx(WEIGHT)
    assert o.acceleration_world == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    assert not o.in_contact


def test_rotor_speed_lags_exponentially_and_saturates():
    m = fly(start(), (10.0, 20.0, 60.0, -5.0), 0.03).motion
    rise = 1.0 - math.exp(-0.03 / 0.02)
    per_volt = 150.0 * 2.0 / 3.0 * 2.0 * math.pi / 60.0
    assert m.rotor_speed == pytest.approx([v * per_volt * rise for v in (10.0, 20.0, 44.4, 0.0)], rel=1e-6)


@pytest.mark.parametrize(
    ("stronger", "axis", "sign"),
    [((0, 1), 0, 1), ((0, 3), 1, -1), ((0, 2), 2, 1)],
    ids=["left rotors roll right", "front rotors lift the nose", "rotors 1 and 3 turn left"],
)
def test_signs_of_roll_pitch_and_yaw(stronger, axis, sign):
    voltage = [HOVER_VOLTAGE * (1.02 if k in stronger else 0.98) for k in range(4)]
    omega = fly(start(speed=HOVER_SPEED), voltage, 0.2).motion.omega_body
    assert sign * omega[axis] > 1e-3
    assert abs(omega[axis]) > 10 * max(abs(omega[k]) for k in range(3) if k != axis)


def test_torque_free_rotation_keeps_momentum_and_energy():
    p = BARE._replace(effects=BARE.effects[:1])
    inertia = np.array(DRONE.mass.inertia)
    before = start((2.0, -3.0, 1.5), p=p).motion
    after = fly(start((2.0, -3.0, 1.5), p=p), (0.0,) * 4, 2.0, p=p).motion

    def momentum_world(m):
        return Rotation.from_quat(m.attitude, scalar_first=True).apply(inertia * m.omega_body)

    assert momentum_world(after) == pytest.approx(momentum_world(before), rel=1e-8)
    assert inertia @ np.square(after.omega_body) == pytest.approx(inertia @ np.square(before.omega_body), rel=1e-8)
    assert not np.allclose(after.omega_body, before.omega_body, atol=0.1)


def test_agrees_with_independent_implementation():
    """The reference is Newton-Euler with a rotation matrix and full inertia tensor in SciPy's eighth-order method."""
    voltage = np.array([33.0, 30.0, 34.0, 32.0])
    position = np.array(DRONE.rotors.position)
    inertia, mass = np.diag(DRONE.mass.inertia), DRONE.mass.total
    thrust_constant = 0.07376 * 1.225 * 0.5588**4 / (4 * math.pi**2)
    ratio = BARE.effects[1].torque_constant / BARE.effects[1].thrust_constant
    thrust_constant *= BARE.effects[1].thrust_constant * 1.225 / thrust_constant  # the constant is tested elsewhere

    def rate(_, x):
        R, v, w, speed = x[3:12].reshape(3, 3), x[12:15], x[15:18], x[18:]
        thrust = thrust_constant * speed**2
        force = R @ np.array([0, 0, thrust.sum()]) - np.array([0, 0, mass * G])
        torque = np.cross(position, np.outer(thrust, [0, 0, 1])).sum(axis=0)
        torque[2] += ratio * np.array([1, -1, 1, -1]) @ thrust
        skew = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        spin = np.linalg.solve(inertia, torque - np.cross(w, inertia @ w))
        return np.concatenate([v, (R @ skew).ravel(), force / mass, spin, (voltage * 10 * math.pi / 3 - speed) / 0.02])

    x0 = np.concatenate([[0, 0, 10], np.eye(3).ravel(), np.zeros(3), [0.4, -0.2, 0.9], np.full(4, 300.0)])
    x = solve_ivp(rate, (0, 1), x0, method="DOP853", rtol=1e-11, atol=1e-11).y[:, -1]
    m = fly(start((0.4, -0.2, 0.9), speed=300.0), voltage, 1.0).motion
    assert m.position_world == pytest.approx(x[:3], abs=1e-7)
    assert Rotation.from_quat(m.attitude, scalar_first=True).as_matrix() == pytest.approx(
        x[3:12].reshape(3, 3), abs=1e-7
    )
    assert m.velocity_world == pytest.approx(x[12:15], abs=1e-7)
    assert m.omega_body == pytest.approx(x[15:18], abs=1e-7)
    assert m.rotor_speed == pytest.approx(x[18:], abs=1e-5)


def test_converges_with_fourth_order():
    voltage = (33.0, 30.0, 34.0, 32.0)
    exact = fly(start((1.0, -2.0, 3.0), speed=300.0), voltage, 0.64, h=1e-4).motion
    error = [
        np.linalg.norm(
            np.subtract(
                fly(start((1.0, -2.0, 3.0), speed=300.0), voltage, 0.64, h).motion.position_world, exact.position_world
            )
        )
        for h in (0.01, 0.005, 0.0025)
    ]
    assert np.log2(np.divide(error[:-1], error[1:])) == pytest.approx(4.0, abs=0.3)


def test_two_intervals_equal_one_of_twice_length():
    voltage = (33.0, 30.0, 34.0, 32.0)
    state = start((0.1, 0.2, 0.3), speed=300.0)
    half = multirotor.advance(RK4, BARE, KEY, 0, state, voltage, 1e-3, 4)
    assert multirotor.advance(RK4, BARE, KEY, 1, half, voltage, 1e-3, 4) == fly(state, voltage, 0.008)


def test_observed_acceleration_is_slope_of_velocity():
    attitude = Quaternion(*np.array([0.9, 0.1, -0.3, 0.2]) / math.sqrt(0.95))
    state = start((0.4, -0.2, 0.9), attitude, 300.0)
    voltage = (33.0, 30.0, 34.0, 32.0)
    o = multirotor.observe(BARE, 0, 0.004, state, voltage)
    h = 1e-5
    later = fly(state, voltage, h, h).motion
    assert o.acceleration_world == pytest.approx(
        np.subtract(later.velocity_world, state.motion.velocity_world) / h, abs=1e-2
    )
    assert o.angular_acceleration_body == pytest.approx(
        np.subtract(later.omega_body, state.motion.omega_body) / h, abs=1e-2
    )
    assert o.rotor_acceleration == pytest.approx(np.subtract(later.rotor_speed, state.motion.rotor_speed) / h, rel=1e-3)


def test_current_and_power_at_hover():
    """Power is shaft power of the static propeller plus idle losses; the motor constant is 60 / (2 pi KV) V s/rad."""
    o = multirotor.observe(BARE, 0, 0.004, start(speed=HOVER_SPEED), (HOVER_VOLTAGE,) * 4)
    shaft = o.torque[0] * HOVER_SPEED
    constant = 60.0 / (2.0 * math.pi * 150.0)
    assert o.motor_current[0] == pytest.approx(o.torque[0] * (2 / 3) / constant + 1.0)
    assert o.motor_power[0] == pytest.approx(shaft + HOVER_VOLTAGE * 1.0)
    assert 250.0 < o.motor_power[0] < 450.0
    off = multirotor.observe(BARE, 0, 0.004, start(), (0.0,) * 4)
    assert off.motor_current == (0.0,) * 4


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        ((), True),
        (("ground_contact",), True),
        (("ground_effect",), False),
        (("ground_contact", "ground_effect"), False),
    ],
)
def test_steps_with_some_effects_asleep_are_compiled_where_one_of_them_is_not_stiff(names, expected):
    active = effects.from_scene({name: {} for name in ("gravity", "rotor_thrust", *names)}, DRONE)
    assert only_stiff_sleep(numba.typeof(active)) is expected
