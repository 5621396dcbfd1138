"""OS4: four experiments, first-order predictions, conserved quantities and motors."""

import math

import numpy as np
import pytest

from lapwing.dynamics.integrators import get, rate, simulate
from lapwing.dynamics.lie.quaternion import NO_ROTATION, exp, to_roll_pitch_yaw
from lapwing.kernels.state_tree import unflatten
from lapwing.papers.quadrotor_os4 import Os4Motors, Os4Parameters, Os4State, net_force

ZERO = (0.0, 0.0, 0.0)
OS4 = Os4Parameters(0.650, (7.5e-3, 7.5e-3, 1.3e-2), 0.23, 3.13e-5, 7.5e-7, 6.0e-5, 9.81, (0.1, 0.1, 0.1))
RPM = math.pi / 30.0


def start(*rpm):
    return Os4State(ZERO, NO_ROTATION, ZERO, ZERO, tuple(r * RPM for r in rpm))


def fly(rpm, p=OS4, method="lie_euler"):
    _, states = simulate(get(method), p, start(*rpm), 1e-3, 3000, every=3000)
    return unflatten(start(*rpm), tuple(map(float, states[-1])))


def test_experiment_1_hovers():
    end = fly((2155,) * 4)
    assert end.attitude == NO_ROTATION
    assert end.position_world[:2] == (0.0, 0.0)
    # the rounded speed is about 0.03 rpm too low
    lift = net_force(OS4, start(2155, 2155, 2155, 2155))[2]
    assert abs(lift) < 1e-3 * OS4.mass * OS4.gravity
    assert abs(end.position_world[2]) < 0.5 * abs(lift) / OS4.mass * 9.0 * 1.01


@pytest.mark.parametrize("method", ["lie_euler", "rkmk4"])
def test_experiments_2_to_4_follow_published_directions(method):
    two, three, four = (
        fly(r, method=method) for r in ((2155, 2154, 2155, 2156), (2154, 2155, 2156, 2155), (2154, 2154, 2156, 2156))
    )
    level = fly((2155,) * 4, method=method).position_world[2]
    x, y, z = two.position_world
    assert y > 0.1
    assert abs(x) < 1e-3
    assert z < level
    x, y, z = three.position_world
    assert x > 0.1
    assert abs(y) < 1e-3
    assert z < level
    x, y, z = four.position_world
    assert min(x, y) > 0.1
    assert z < level
    for end in (two, three, four):
        assert abs(end.omega_body[2]) < 1e-5  # the drag torques all but cancel (eq. (7.16))


def test_roll_and_drift_of_experiment_2_in_closed_form():
    # torque about x only, so that roll = -a t^2 / 2 and, while small, y = g a t^4 / 24 without drag
    p = OS4._replace(translational_drag=ZERO, rotor_inertia=0.0, drag_constant=0.0)
    w2, w4 = 2154 * RPM, 2156 * RPM
    a = p.arm * p.lift_constant * (w4**2 - w2**2) / p.inertia[0]
    end = fly((2155, 2154, 2155, 2156), p, "rkmk4")
    roll, pitch, yaw = to_roll_pitch_yaw(end.attitude)
    assert roll == pytest.approx(-a * 4.5, rel=1e-12)
    assert (pitch, yaw) == pytest.approx((0.0, 0.0), abs=1e-15)
    thrust = net_force(p, start(2155, 2154, 2155, 2156))[2] + p.mass * p.gravity
    t = np.linspace(0, 3, 3001)
    pushed = thrust / p.mass * np.sin(a * t**2 / 2)
    velocity = np.concatenate([[0], np.cumsum((pushed[1:] + pushed[:-1]) / 2) * 1e-3])
    assert end.position_world[1] == pytest.approx(((velocity[1:] + velocity[:-1]) / 2).sum() * 1e-3, rel=1e-6)


def test_net_vertical_force_to_first_order():
    # the paper's lemma: to first order the net force is weight times the tilted axis less the upright one
    x = start(2154, 2155, 2156, 2155)._replace(attitude=exp((0.0, 0.1, 0.0)))
    weight = 4 * OS4.lift_constant * (2155 * RPM) ** 2
    assert net_force(OS4, x) == pytest.approx((weight * math.sin(0.1), 0.0, weight * (math.cos(0.1) - 1)), abs=3e-3)


def test_residual_rotor_speed_precesses_body():
    # only rotors 2 and 4, both in one direction: a gyroscope, J omega' = Omega_r J_r e3 x omega
    x = start(0, 2155, 0, 2155)._replace(omega_body=(0.2, 0.0, 0.0))
    spin = OS4.rotor_inertia * 2 * 2155 * RPM
    actual = rate(OS4._replace(drag_constant=0.0), 0.0, x)
    assert actual.omega_body == pytest.approx((0.0, spin * 0.2 / 7.5e-3, 0.0), rel=1e-12)


def test_free_fall_and_momentum_without_rotors():
    p = OS4._replace(translational_drag=ZERO)
    x = Os4State(ZERO, exp((0.3, 0.2, -0.5)), (1.0, 0.0, 2.0), (1.0, -2.0, 3.0), (0.0,) * 4)
    _, states = simulate(get("rkmk4"), p, x, 1e-2, 100, every=100)
    assert states[-1, :3] == pytest.approx([1.0, 0.0, 2.0 - 9.81 / 2], abs=1e-10)


def steady_voltage(p, constant, resistance, speed):
    """Return the voltage [V] that holds a rotor at a speed [rad/s] (theory, eq. (7.14) at rest)."""
    return resistance * p.drag_constant * speed * speed / constant + constant * speed


def test_motors_reach_voltage_speed_and_react_on_body():
    speed, km, r = 2155 * RPM, 5.2e-3, 0.6
    u = steady_voltage(OS4, km, r, speed)
    p = OS4._replace(motors=Os4Motors((u, u, u, u), km, r))
    resting = start(0, 0, 0, 0)
    _, states = simulate(get("rkmk4"), p, resting, 1e-3, 20_000, every=20_000)
    assert states[-1, -4:] == pytest.approx([speed] * 4, rel=1e-6)
    # spinning up only rotors 2 and 4 turns the body about z in the opposite direction, by their momentum
    q = p._replace(motors=Os4Motors((0.0, u, 0.0, u), km, r), drag_constant=0.0)
    _, states = simulate(get("rkmk4"), q, resting, 1e-3, 500, every=500)
    rotor = q.rotor_inertia * (states[-1, -3] + states[-1, -1])
    assert states[-1, 12] * q.inertia[2] == pytest.approx(-rotor, rel=1e-9)
