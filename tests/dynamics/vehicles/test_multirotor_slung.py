"""Slung load against closed forms: pendulum, conservation, free fall on a slack cable, force of a taut cable."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk

import lapwing
from lapwing.dynamics import effects
from lapwing.dynamics.integrators import get
from lapwing.dynamics.lie.quaternion import NO_ROTATION, rotate
from lapwing.dynamics.noise import stream_key
from lapwing.dynamics.terrain import LEVEL
from lapwing.dynamics.vehicles import multirotor_slung as slung
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.kernels import python_function
from lapwing.services.common.schemas.run_schema import SHIPPED
from lapwing.services.scene_resolver import load
from tests.dynamics.vehicles.rebound import rebound

pytestmark = pytest.mark.long

QUAD = load_airframe(SHIPPED / "vehicles/quad_x.toml")
RK4 = get("rk4_renormalised").Method()
KEY = stream_key(1, "drone1", "plant")
SLING = slung.Sling(0.3, 2.0, 2000.0, 0.0, (0.05, 0.0, -0.1), 0.0, LEVEL)
G, H = 9.80665, 1e-3


def vehicle(sling):
    return slung.parameters(QUAD, sling, effects.from_scene({"gravity": {}, "rotor_thrust": {}}, QUAD))


def simulate(p, x, seconds, h=H):
    state = slung.initial_state(p)._replace(motion=x)
    return slung.multirotor.advance(RK4, p, KEY, 0, state, (0.0,) * 4, h, round(seconds / h)).motion


def begin(p, load, load_velocity, omega=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0)):
    x = slung.initial_state(p, (0.0, 0.0, 100.0), NO_ROTATION, 0.0, velocity, omega).motion
    return x._replace(load_position=load, load_velocity=load_velocity)


def invariants(x):
    """Return (energy [J], momentum [N s], angular momentum about the common centre of mass [N m s])."""
    v, m, inertia = x.vehicle, QUAD.mass.total, np.array(QUAD.mass.inertia)
    position, load = np.array(v.position_world), np.array(x.load_position)
    velocity, load_velocity, omega = np.array(v.velocity_world), np.array(x.load_velocity), np.array(v.omega_body)
    away = load - position - np.array(rotate(v.attitude, SLING.hook_body))
    stretch = max(np.linalg.norm(away) - SLING.length, 0.0)
    kinetic = 0.5 * (
        m * velocity @ velocity + SLING.load_mass * load_velocity @ load_velocity + inertia * omega @ omega
    )
    momentum = m * velocity + SLING.load_mass * load_velocity
    spin = np.array(rotate(v.attitude, tuple(inertia * omega)))
    reduced = 1.0 / (1.0 / m + 1.0 / SLING.load_mass)
    angular = spin + reduced * np.cross(load - position, load_velocity - velocity)
    height = G * (m * position[2] + SLING.load_mass * load[2])
    return kinetic + height + 0.5 * SLING.stiffness * stretch**2, momentum, angular


def test_load_on_fixed_hook_is_pendulum():
    """The period is 4 sqrt(L / g) K(sin^2(a / 2)), L including the stretch under the load."""
    sling = SLING._replace(stiffness=2e4)

    def slope(_, s):
        away, velocity = tuple(s[:3]), tuple(s[3:])
        pull = np.array(python_function(slung.tension)(sling, away, velocity)[0])
        return [*velocity, *(np.array([0.0, 0.0, -G]) - pull / sling.load_mass)]

    def lowest(_, s):
        return s[0]

    lowest.direction = 1.0
    angle, length = 0.6, sling.length + sling.load_mass * G / sling.stiffness
    start = [length * math.sin(angle), 0.0, -length * math.cos(angle), 0.0, 0.0, 0.0]
    period = 4.0 * math.sqrt(length / G) * ellipk(math.sin(0.5 * angle) ** 2)
    crossings = solve_ivp(
        slope, (0.0, 3.2 * period), start, events=lowest, rtol=1e-8, atol=1e-9, max_step=0.02
    ).t_events[0]
    assert np.diff(crossings).mean() == pytest.approx(period, rel=5e-4)


def test_with_taut_cable_energy_and_both_momenta_are_kept():
    p = vehicle(SLING)
    x = begin(p, (0.05, 0.3, 97.9), (2.0, 0.5, 0.0), omega=(0.3, -0.2, 0.5))
    energy, momentum, angular = invariants(x)
    after = invariants(simulate(p, x, 3.0, 2.5e-4))
    assert after[0] == pytest.approx(energy, abs=1e-5)
    assert after[1] == pytest.approx(momentum - [0.0, 0.0, 3.0 * G * (QUAD.mass.total + SLING.load_mass)], abs=1e-9)
    assert after[2] == pytest.approx(angular, abs=1e-7)


def test_on_slack_cable_both_fall_freely():
    p = vehicle(SLING)
    x = simulate(p, begin(p, (0.5, 0.0, 99.5), (0.3, 0.2, 1.0), velocity=(0.1, 0.0, 0.0)), 0.8)
    assert x.load_position == pytest.approx((0.74, 0.16, 99.5 + 0.8 - 0.32 * G), abs=1e-9)
    assert x.vehicle.position_world == pytest.approx((0.08, 0.0, 100.0 - 0.32 * G), abs=1e-9)
    assert x.vehicle.omega_body == (0.0, 0.0, 0.0)


def test_taut_cable_force_is_bounded_by_stiffness():
    """The bound in free fall without damping is the separation speed times sqrt(stiffness times reduced mass)."""
    sling = SLING._replace(hook_body=(0.0, 0.0, 0.0))
    p, speed = vehicle(sling), 1.5
    x, most = begin(p, (0.0, 0.0, 98.2), (0.0, 0.0, -speed)), 0.0
    for _ in range(250):
        x = simulate(p, x, 1e-3, 2.5e-4)
        most = max(most, math.hypot(*python_function(slung.cable)(sling, (1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0), x)[0]))
    reduced = 1.0 / (1.0 / sling.load_mass + 1.0 / QUAD.mass.total)
    assert most == pytest.approx(speed * math.sqrt(sling.stiffness * reduced), rel=2e-3)
    apart = x.load_velocity[2] - x.vehicle.velocity_world[2]
    assert apart == pytest.approx(speed, rel=2e-3)  # rebounds at the same speed: no loss


def test_damped_cable_pulls_and_never_pushes():
    sling = SLING._replace(damping=500.0)
    closing, _ = python_function(slung.tension)(sling, (0.0, 0.0, -2.001), (0.0, 0.0, 3.0))
    assert closing == (0.0, 0.0, 0.0)
    opening, _ = python_function(slung.tension)(sling, (0.0, 0.0, -2.001), (0.0, 0.0, -1.0))
    assert opening[2] == pytest.approx(-502.0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"slung_load.stiffness": 2e6}, r"solver.step: the load on the taut cable swings along it with 2828 rad/s"),
        (
            {"vehicle.model": "rigid_body"},
            'slung_load: the model rigid_body has no such table; set vehicle.model = "slung_load"',
        ),
        ({"slung_load.mass": 0.0}, "slung_load.mass: expected a number above 0"),
    ],
)
def test_invalid_cable_parameters_are_rejected(changes, message):
    with pytest.raises(lapwing.SceneError, match=message):
        load("slung_load", changes)


def test_autopilot_lifts_and_carries_load_at_height():
    flight = lapwing.fly("slung_load", {"run.duration": 20.0})
    assert not flight.failure
    body, truth = flight.topic("body_states"), flight.truth
    holding, loaded = truth.times > 18.0, body.times > 18.0
    assert truth.position[holding, 2] == pytest.approx(6.11, abs=0.15)
    away = truth.position[np.searchsorted(truth.times, body.times[loaded])] - body.position[loaded, 0]
    assert np.linalg.norm(away, axis=1) == pytest.approx(2.0, abs=0.03)
    assert body.position[loaded, 0, 0].mean() == pytest.approx(8.0, abs=0.4)
    weight = 0.3 * G
    assert body.force[loaded, 0, 2].mean() == pytest.approx(weight, rel=0.05)
    assert body.position[0, 0, 2] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("h", [4e-3, 1e-3])
def test_load_rebounds_from_taut_cable_as_damped_spring(h):
    """In free fall every step is as accurate as the tolerance."""
    ratio, speed, slack = 0.1, 1.5, 0.02
    reduced = 1.0 / (1.0 / SLING.load_mass + 1.0 / QUAD.mass.total)
    w = math.sqrt(SLING.stiffness / reduced)
    sling = SLING._replace(hook_body=(0.0, 0.0, 0.0), damping=2.0 * ratio * w * reduced)
    p = vehicle(sling)._replace(tolerance=1e-10)
    seconds = 0.1
    stretch, rate = rebound(slack, speed, w, ratio, seconds)
    apart = SLING.length + stretch
    x = simulate(p, begin(p, (0.0, 0.0, 100.0 - SLING.length + slack), (0.0, 0.0, -speed)), seconds, h)
    assert x.vehicle.position_world[2] - x.load_position[2] == pytest.approx(apart, abs=1e-7)
    assert x.vehicle.velocity_world[2] - x.load_velocity[2] == pytest.approx(rate, abs=1e-7)
