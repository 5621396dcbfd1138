"""Controllers of the cooperative load against the equations of motion and the published flight."""

import math

import numpy as np
import pytest

from lapwing.dynamics.integrators import get, rate, simulate
from lapwing.dynamics.lie.quaternion import NO_ROTATION, Quaternion, exp, from_matrix
from lapwing.dynamics.lie.ts2 import Swing, normalise
from lapwing.kernels.state_tree import retract, scale, unflatten
from lapwing.papers.cooperative_load import cooperative_control as forces_of
from lapwing.papers.cooperative_load.cooperative_control import FormationControl
from lapwing.papers.cooperative_load.cooperative_load import (
    CooperativeLoadParameters,
    CooperativeLoadState,
    command,
    link_acceleration,
    load_acceleration,
    thrust_world,
)

ZERO = (0.0, 0.0, 0.0)
INERTIA = (0.0820, 0.0845, 0.1377)
G = 9.81


def link(angle_deg):
    """Return the direction from quadrotor to load, `angle` from the downward vertical in the x-z plane."""
    a = math.radians(angle_deg)
    return (math.sin(a), 0.0, -math.cos(a))


def published():
    """Return the published case of two quadrotors; its third axis points down, so y and z change sign in ENU."""
    law = FormationControl(
        12.0, 5.0, 16.0, 5.0, 9.0, 3.0, 0.9,
        ((-2.5, 0.0, 7.0 - 2.5**2), (1.0, 0.0, 5.0), (0.0, 0.0, -1.0)),
        (link(30.0), link(-30.0)),
    )  # fmt: skip
    p = CooperativeLoadParameters((0.755, 0.755), (INERTIA, INERTIA), (0.6, 0.8), 0.4, G, law)
    start = CooperativeLoadState(
        (-2.0, 0.0, 0.0), ZERO, (NO_ROTATION,) * 2, (ZERO,) * 2, (Swing(link(80.0), ZERO), Swing(link(-80.0), ZERO))
    )
    return p, start


def tripod():
    """Return a swinging system of three quadrotors whose links span space."""
    spread = [(0.5 * math.cos(a), 0.5 * math.sin(a), -math.sqrt(0.75)) for a in (0.0, 2.1, 4.2)]
    p, _ = published()
    law = p.control._replace(direction=tuple(spread))
    p = CooperativeLoadParameters((0.755, 0.9, 0.6), (INERTIA,) * 3, (0.6, 0.8, 1.1), 0.4, G, law)
    swings = tuple(normalise(Swing((q[0] + 0.1, q[1] - 0.05, q[2]), (0.4, -0.2, 0.3))) for q in spread)
    return p, CooperativeLoadState(
        (-2.4, 0.1, 0.6), (0.9, 0.0, 4.8), (exp((0.1, -0.2, 0.05)),) * 3, (ZERO,) * 3, swings
    )


def test_desired_path_equals_published_path():
    p, _ = published()
    for t in (0.0, 1.3, 5.0):
        position, velocity, acceleration = forces_of.desired_load(p.control.path, t)
        assert position == pytest.approx((t - 2.5, 0.0, -((t - 2.5) ** 2 - 7.0)), abs=1e-14)
        assert velocity == pytest.approx((1.0, 0.0, -2 * (t - 2.5)), abs=1e-14)
        assert acceleration == (0.0, 0.0, -2.0)


def forces(p, t, x, acceleration=ZERO, omega_rate=(ZERO,) * 3):
    expected, slope = forces_of.desired_specific_force(p, t, x, acceleration)
    s, s_rate = forces_of.shares(p, x, expected, slope)
    n = len(x.link)
    return expected, [forces_of.desired_force(p, x, expected, slope, s, s_rate, omega_rate[i], i) for i in range(n)]


def test_desired_forces_produce_desired_motion():
    p, x = tripod()
    expected, pairs = forces(p, 0.3, x)
    force = tuple(f for f, _ in pairs)
    specific = load_acceleration(p, x, force)
    # the damping of the shares leaves a second-order term
    assert specific == pytest.approx(expected, abs=0.03 * max(map(abs, expected)))
    for i in range(3):
        q, omega = x.link[i].direction, x.link[i].omega
        swing = -16.0 * np.cross(p.control.direction[i], q) - 5.0 * np.array(omega)
        exact = np.array(swing) + np.cross(q, np.array(specific) - expected) / p.link_length[i]
        assert link_acceleration(p, x, force, specific, i) == pytest.approx(exact, abs=1e-12)


@pytest.mark.long
def test_derivatives_of_desired_forces_along_motion():
    p, x = published()
    links = tuple(normalise(Swing(q, (0.4, -0.2, 0.3))) for q in ((0.3, 0.1, -0.9), (-0.4, 0.2, -0.8)))
    x = x._replace(load_velocity=(0.9, 0.1, 4.8), attitude=(exp((0.1, -0.2, 0.05)),) * 2, link=links)
    tangent = rate(p, 0.3, x)
    specific = np.add(tangent.load_velocity, (0.0, 0.0, G))
    values = command(p, 0.3, x)
    force = tuple(thrust_world(x, values.thrust, i) for i in range(2))
    omega_rate = [link_acceleration(p, x, force, tuple(specific), i) for i in range(2)]
    _, pairs = forces(p, 0.3, x, tangent.load_velocity, omega_rate)
    h = 1e-5
    ahead, behind = (forces(p, 0.3 + s * h, retract(x, scale(s * h, tangent)))[1] for s in (1, -1))
    for (_, actual), (a, _), (b, _) in zip(pairs, ahead, behind, strict=True):
        assert actual == pytest.approx((np.array(a) - b) / (2 * h), rel=1e-6, abs=1e-6)


def test_desired_attitude_and_its_rate():
    force, force_rate, h = np.array((1.0, -2.0, 7.0)), np.array((0.5, 0.3, -1.0)), 1e-6
    matrix, omega = forces_of.desired_attitude(tuple(force), tuple(force_rate))
    m = np.array(matrix).reshape(3, 3)
    assert m @ (0, 0, 1) == pytest.approx(force / np.linalg.norm(force))
    assert m[0, 1] == pytest.approx(0.0, abs=1e-16)  # body x stays in the plane of z and world x, and towards that
    assert m[0, 0] > 0.0
    assert np.linalg.det(m) == pytest.approx(1.0)
    ahead, behind = (forces_of.desired_attitude(tuple(force + s * h * force_rate), ZERO)[0] for s in (1, -1))
    spin = m.T @ (np.array(ahead) - behind).reshape(3, 3) / (2 * h)
    assert (spin[2, 1], spin[0, 2], spin[1, 0]) == pytest.approx(omega, abs=1e-9)


def test_force_that_points_down_does_not_tip_quadrotor_over():
    for z in (-20.0, 0.0, 1.0):
        kept, _ = forces_of.upright((3.0, 1.0, z), (0.0, 0.0, 1.0), 2.0)
        assert kept[2] >= 2.0
    kept, slope = forces_of.upright((3.0, 1.0, 8.0), (0.0, 0.0, 1.0), 2.0)
    assert kept == pytest.approx((3.0, 1.0, 8.0), rel=2e-3)
    ahead, behind = (forces_of.upright((0.0, 0.0, 2.1 + s * 1e-6), ZERO, 2.0)[0][2] for s in (1, -1))
    assert forces_of.upright((0.0, 0.0, 2.1), (0.0, 0.0, 1.0), 2.0)[1][2] == pytest.approx(
        (ahead - behind) / 2e-6, rel=1e-6
    )
    assert slope[2] == pytest.approx(1.0, abs=2e-3)


def test_moment_vanishes_at_desired_attitude_and_opposes_error():
    p, x = published()
    force = (0.0, 0.0, 10.0)
    aligned = from_matrix(forces_of.desired_attitude(force, ZERO)[0])
    assert isinstance(aligned, Quaternion)
    assert forces_of.moment(p, x._replace(attitude=(aligned,) * 2), force, ZERO, 0) == pytest.approx(ZERO, abs=1e-14)
    tilted = x._replace(attitude=(exp((0.1, 0.0, 0.0)),) * 2)
    assert forces_of.moment(p, tilted, force, ZERO, 0) == pytest.approx(
        (-9.0 / 0.81 * math.sin(0.1), 0.0, 0.0), abs=1e-12
    )


@pytest.mark.long
def test_published_flight_reaches_path_formation_and_attitude():
    p, x0 = published()
    _, rows = simulate(get("rkmk4"), p, x0, 5.0 / 2000, 2000, every=1000)
    for t, row in zip((2.5, 5.0), rows[1:], strict=True):
        now = unflatten(x0, tuple(map(float, row)))
        position, velocity, _ = forces_of.desired_load(p.control.path, t)
        assert now.load_position == pytest.approx(position, abs=5e-3)
        assert now.load_velocity == pytest.approx(velocity, abs=5e-2)
        for i, angle in enumerate((30.0, -30.0)):
            assert now.link[i].direction == pytest.approx(link(angle), abs=5e-3)
            assert max(map(abs, now.omega_body[i])) < 0.1
