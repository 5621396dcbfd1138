"""The vehicle of five bodies: the reduced one where it must be, and the wobble that only it knows."""

import math
from pathlib import Path

import numpy as np
import pytest

from dynamics import effects
from dynamics.cell import Cell
from dynamics.integrators import get
from dynamics.noise import stream_key
from dynamics.vehicles import multirotor
from dynamics.vehicles.airframe import load_airframe
from dynamics.vehicles.propellers import propellers_of

DRONE = load_airframe(Path(__file__).parents[3] / "scenes/vehicles/delivery_drone.toml")
RK4, KEY, H = get("rk4_renormalised").Method(), stream_key(1, "drone1", "plant"), 5e-4
TABLES = {"gravity": {}, "rotor_thrust": {}}
G = 9.80665  # [m/s^2] of the effect gravity
MASS, MOMENTS = DRONE.rotors.mass, (*DRONE.rotors.transverse_inertia, DRONE.rotors.inertia)


def airframe(**changed):
    return DRONE.model_copy(update={"rotors": DRONE.rotors.model_copy(update=changed)})


def fly(p, state, command, seconds, every=0.01):
    """States every 10 ms."""
    n, states = round(every / H), [state]
    for tick in range(round(seconds / every)):
        states.append(multirotor.advance(RK4, p, KEY, tick, states[-1], command, H, n))
    return states


def tumbling(p, omega=(1.0, -0.7, 0.4), speed=300.0):
    state = multirotor.initial_state(p, (0.0, 0.0, 50.0), rotor_speed=speed)
    return state._replace(motion=state.motion._replace(omega_body=omega))


@pytest.mark.parametrize("torque_driven", [False, True])
def test_with_symmetric_propellers_it_is_the_reduced_model(torque_driven):
    """Equal transverse moments: nothing turns with the blades, so one rigid body with gyroscopic rotors is the same."""
    frame = airframe(transverse_inertia=(MOMENTS[1], MOMENTS[1]))
    five = multirotor.parameters(frame, effects.from_scene(TABLES, frame), propellers_of(frame, torque_driven, G))
    position = np.array(frame.rotors.position)
    hubs = MASS * (np.sum(position**2) * np.eye(3) - position.T @ position)
    inertia = np.array(frame.mass.inertia) + np.diag(hubs) + 4 * np.array((MOMENTS[1], MOMENTS[1], MOMENTS[2]))
    whole = frame.model_copy(update={"mass": frame.mass.model_copy(update={"inertia": tuple(map(float, inertia))})})
    one = multirotor.parameters(whole, effects.from_scene(TABLES | {"rotor_gyro": {}}, whole))
    command = (24.0, 24.3, 24.1, 23.8)
    a, b = (fly(p, tumbling(p), command, 1.0)[-1].motion for p in (five, one))
    # torques instead of speeds: the rotors also feel that the body turns, ever so little
    close = 2e-4 if torque_driven else 1e-9
    for field in ("position_world", "attitude", "omega_body", "rotor_speed"):
        assert getattr(a, field) == pytest.approx(getattr(b, field), rel=close, abs=close), field


def test_the_blades_make_the_rates_ripple_at_twice_their_speed():
    """Turning about x without torque: I_x(t) omega_x is kept, and I_x swings by four times half the difference."""
    p = multirotor.parameters(DRONE, (), propellers_of(DRONE, False, 0.0))
    speed = 100.0
    command = (speed / p.layout.speed_per_volt,) * 4
    states = fly(p, tumbling(p, (1.0, 0.0, 0.0), speed), command, 1.0, every=H)
    ripple = np.array([s.motion.omega_body[0] for s in states[:-1]])
    spectrum = np.abs(np.fft.rfft(ripple - ripple.mean()))
    frequency = np.fft.rfftfreq(len(ripple), H)[spectrum.argmax()]
    assert frequency == pytest.approx(2 * speed / (2 * math.pi), abs=0.6)
    half = 2.0 * (MOMENTS[1] - MOMENTS[0])  # four propellers, half the difference of each
    arm = 4 * MASS * DRONE.rotors.position[0][1] ** 2
    mean = DRONE.mass.inertia[0] + arm + 2.0 * (MOMENTS[0] + MOMENTS[1])
    # at the start the blades lie along x, where their moment is least
    momentum = (mean - half) * 1.0
    assert ripple.min() == pytest.approx(momentum / (mean + half), rel=1e-5)
    assert ripple.max() == pytest.approx(1.0, rel=1e-5)


def test_a_hub_bears_the_thrust_and_the_shaft_the_drag():
    p = multirotor.parameters(DRONE, effects.from_scene(TABLES, DRONE), propellers_of(DRONE, True, G))
    speed = math.sqrt(DRONE.mass.total * G / (4 * multirotor.STANDARD_DENSITY * p.effects[1].thrust_constant))
    state = multirotor.initial_state(p, (0.0, 0.0, 10.0), rotor_speed=speed)
    command = (speed / p.layout.speed_per_volt,) * 4
    _, force, torque = multirotor.hinges(Cell(p), 0, 0.004, Cell(state), command)
    thrust = DRONE.mass.total * G / 4
    drag = thrust * p.effects[1].torque_constant / p.effects[1].thrust_constant
    for f, t, sign in zip(force, torque, DRONE.rotors.yaw_sign, strict=True):
        assert f == pytest.approx((0.0, 0.0, MASS * G - thrust), abs=1e-9)
        assert t == pytest.approx((0.0, 0.0, -sign * drag), abs=1e-12)


def test_an_airframe_that_does_not_tell_is_refused():
    with pytest.raises(ValueError, match=r"rotors: the multibody model needs mass \[kg\]"):
        propellers_of(airframe(mass=None), True, G)
    three = DRONE.rotors.model_copy(update={"position": DRONE.rotors.position[:3]})
    with pytest.raises(ValueError, match="4 propellers, this airframe has 3"):
        propellers_of(DRONE.model_copy(update={"rotors": three}), True, G)
