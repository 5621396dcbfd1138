"""Gyrostat against the published equations; invariants, four published cases and attitude control."""

import math

import numpy as np
import pytest

from lapwing.dynamics.integrators import get, rate, simulate, solve
from lapwing.dynamics.lie.quaternion import NO_ROTATION, exp, log, multiply
from lapwing.dynamics.vehicles.rigid_body import FreeBodyParameters, RigidBody
from lapwing.papers.gyrostat import GyrostatParameters

ZERO = (0.0, 0.0, 0.0)
INERTIA = (500.0, 500.0, 1000.0)
GE_LIN = GyrostatParameters(
    INERTIA, (200.0, 200.0, 250.0), 4.5, 1.0, 200.0, (1.0, 1.0, 1.0), (1.0, 1.0, 1.0), 0.0, 0.0, 0.0, NO_ROTATION
)
CHAOTIC = GE_LIN._replace(linear_gain=ZERO, cubic_gain=ZERO)
BLOCKED = CHAOTIC._replace(rotor_momentum=ZERO, damping=0.0)
START = RigidBody(NO_ROTATION, (0.1, 0.1, 0.1))


def published(t, o, p):
    """Return the rates of the three scalar equations, time in minutes."""
    a, b, c = p.inertia
    h1, h2, h3 = p.rotor_momentum
    (x, y, z), f, w = o, p.forcing_amplitude, p.forcing_frequency
    (k1, k3, k5), (k2, k4, k6), g = p.linear_gain, p.cubic_gain, p.desired_rate
    spin = h3 * (1 + f * math.cos(w * t))
    return (
        ((b - c) * y * z - spin * y + h2 * z + k1 * (g - x) + k2 * (g - x) ** 3) / a,
        ((c - a) * x * z - h1 * z + spin * x + k3 * (g - y) + k4 * (g - y) ** 3) / b,
        (
            (a - b) * x * y
            - h2 * x
            + h1 * y
            + h3 * f * w * math.sin(w * t)
            - p.damping * z
            + k5 * (g - z)
            + k6 * (g - z) ** 3
        )
        / c,
    )


@pytest.mark.parametrize(
    "p", [GE_LIN, CHAOTIC, BLOCKED, GE_LIN._replace(desired_rate=0.7, inertia=(400.0, 520.0, 900.0))]
)
def test_rate_equals_published_equations(p):
    for t, o in ((0.0, (0.1, 0.1, 0.1)), (2.3, (-0.4, 1.2, 0.6))):
        actual = rate(p, t, RigidBody(NO_ROTATION, o))
        assert actual.omega_body == pytest.approx(published(t, o, p), rel=1e-14)
        assert actual.attitude == o


def world_momentum(states, h=ZERO):
    momentum = states[:, 4:] * INERTIA + h
    w, u = states[:, :1], states[:, 1:4]
    t = 2 * np.cross(u, momentum)
    return momentum + w * t + np.cross(u, t)


def test_blocked_rotors_equal_free_body():
    _, one = simulate(get("rkmk4"), BLOCKED, START, 0.01, 1000, every=100)
    _, two = simulate(get("rkmk4"), FreeBodyParameters(INERTIA), START, 0.01, 1000, every=100)
    assert (one == two).all()


def test_steady_rotors_keep_energy_and_world_momentum():
    p = CHAOTIC._replace(damping=0.0, forcing_amplitude=0.0)
    times = np.linspace(0.0, 20.0, 41)
    states, _ = solve(p, START, times, 1e-12)
    energy = (states[:, 4:] ** 2 * INERTIA).sum(axis=1)
    assert energy == pytest.approx(np.full(41, energy[0]), rel=1e-9)
    momentum = world_momentum(states, p.rotor_momentum)
    assert abs(momentum - momentum[0]).max() < 1e-8 * np.linalg.norm(momentum[0])


def test_uneven_rotors_keep_momentum_without_friction():
    p = CHAOTIC._replace(damping=0.0)
    times = np.linspace(0.0, 20.0, 41)
    states, _ = solve(p, START, times, 1e-12)
    h1, h2, h3 = p.rotor_momentum
    spin = h3 * (1 + p.forcing_amplitude * np.cos(times))
    total = world_momentum(states, np.column_stack([np.full(41, h1), np.full(41, h2), spin]))
    assert abs(total - total[0]).max() < 1e-8 * np.linalg.norm(total[0])


def test_friction_dissipates_energy():
    p = CHAOTIC._replace(forcing_amplitude=0.0)
    _, states = simulate(get("rkmk4"), p, START, 0.01, 5000, every=50)
    energy = (states[:, 4:] ** 2 * INERTIA).sum(axis=1)
    assert (np.diff(energy) < 1e-12).all()
    assert energy[-1] < 0.9 * energy[0]


def test_neighbouring_starts_diverge_only_in_chaotic_case():
    near = RigidBody(NO_ROTATION, (0.1 + 1e-9, 0.1, 0.1))
    strong = GE_LIN._replace(linear_gain=(100.0, 100.0, 100.0))
    growth = {}
    cases = {"chaotic": CHAOTIC._replace(forcing_amplitude=10.0), "periodic": CHAOTIC, "strong": strong}
    for name, p in cases.items():
        ends = [simulate(get("rkmk4"), p, x, 0.01, 30_000, every=30_000)[1][-1, 4:] for x in (START, near)]
        growth[name] = abs(ends[0] - ends[1]).max() / 1e-9
    assert growth["strong"] < 1e-3
    assert growth["periodic"] < 1.0  # period one, as Ge and Lin found at this amplitude
    assert growth["chaotic"] > 1e6


def test_ten_hours_stay_on_group_and_bounded():
    _, states = simulate(get("rkmk4"), GE_LIN, START, 0.01, 60_000, every=60)
    assert abs((states[:, :4] ** 2).sum(axis=1) - 1).max() < 5e-16
    assert abs(states[:, 4:]).max() < 10.0


@pytest.mark.parametrize("start", [START, RigidBody(exp((0.0, 3.1, 0.0)), (0.5, -0.3, 0.2))])
def test_control_brings_satellite_to_prescribed_attitude(start):
    target = exp((0.6, -0.9, 1.1))
    p = CHAOTIC._replace(attitude_gain=50.0, rate_gain=300.0, target=target)
    _, states = simulate(get("rkmk4"), p, start, 0.02, 10_000, every=10_000)
    error = log(multiply(exp((-0.6, 0.9, -1.1)), tuple(states[-1, :4])))
    assert max(map(abs, error)) < 1e-6
    assert abs(states[-1, 4:]).max() < 1e-6
