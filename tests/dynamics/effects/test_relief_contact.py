"""Plant on uneven ground: landing, rest, sliding off an edge, impact on a wall."""

import math

import numpy as np
import pytest

from lapwing.dynamics import effects
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.integrators import get
from lapwing.dynamics.lie.quaternion import rotation_matrix
from lapwing.dynamics.terrain import relief, surface
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.ground_equilibrium import resting_pose, static_equilibrium

pytestmark = pytest.mark.long

RK4 = get("rk4_renormalised").Method()
G, HEIGHT, OFF = 9.80665, 0.35, (0.0,) * 4
BUMPS = relief(bump_height=0.02, bump_length=1.3)
STAIR = relief(steps=[(1.0, 0.1), (2.0, -0.4)])
GRID = relief(grid=np.add.outer(np.zeros(5), 0.1 * np.arange(5.0)), corner=(-2.0, -2.0))  # rises by 0.1 along x


def vehicle(drone, terrain):
    active = effects.from_scene({"gravity": {}, "ground_contact": {}}, drone, Environment(terrain=terrain))
    return multirotor.parameters(drone, active)


def run(p, state, seconds, h=1e-3):
    return multirotor.advance(RK4, p, (0, 0), 0, state, OFF, h, round(seconds / h))


def dropped(p, place, velocity=(0.0, 0.0, 0.0)):
    return multirotor.initial_state(p, place, velocity_world=velocity)


def feet_over_ground(drone, terrain, motion):
    R = np.reshape(rotation_matrix(motion.attitude), (3, 3))
    places = np.array(motion.position_world) + np.array(drone.contact.feet) @ R.T
    return np.array([z - surface(terrain, x, y)[0] for x, y, z in places])


def still(motion):
    return np.abs(motion.velocity_world + motion.omega_body).max() < 1e-5


@pytest.mark.parametrize("place", [(0.05, 0.02), (0.4, 0.3), (-0.3, 0.9)])
def test_vehicle_lands_on_bumps_on_three_feet_at_least(drone, place):
    p = vehicle(drone, BUMPS)
    m = run(p, dropped(p, (*place, 0.45), (0.0, 0.0, -0.5)), 4.0).motion
    heights = feet_over_ground(drone, BUMPS, m)
    assert still(m)
    assert heights.min() > -1e-4
    assert np.sort(heights)[2] < 1e-5


@pytest.mark.parametrize(("x", "ground"), [(0.0, 0.0), (1.5, 0.1), (3.0, -0.3)])
def test_vehicle_lands_on_treads_of_stair(drone, x, ground):
    p = vehicle(drone, STAIR)
    m = run(p, dropped(p, (x, 0.0, 0.6), (0.0, 0.0, -0.5)), 3.0).motion
    assert still(m)
    assert m.position_world[2] == pytest.approx(ground + HEIGHT, abs=1e-4)


def test_grid_of_points_on_slope_equals_slope(drone):
    slope = relief(slope=(0.1, 0.0))
    ends = []
    for terrain in (slope, GRID):
        p = vehicle(drone, terrain)
        start = static_equilibrium(multirotor, p, resting_pose(drone.contact.feet, terrain), G)
        m = run(p, start, 1.0).motion
        assert np.abs(np.subtract(m.position_world, start.motion.position_world)).max() < 1e-7
        ends.append(m.position_world)
    assert ends[0] == pytest.approx(ends[1], abs=1e-9)


def test_vehicle_slides_off_edge_and_falls(drone):
    """The slide starts 0.7 m before the edge at 3 m/s; the next tread is 0.4 m lower."""
    p = vehicle(drone, STAIR)
    start = dropped(p, (1.3, 0.0, 0.1 + HEIGHT), (3.0, 0.0, 0.0))
    before, after = run(p, start, 0.1).motion, run(p, start, 4.0).motion
    assert before.position_world[2] == pytest.approx(0.1 + HEIGHT, abs=2e-3)
    assert before.velocity_world[0] == pytest.approx(3.0 - 0.3 * G * 0.1, abs=0.1)  # sliding friction
    assert after.position_world[0] > 2.2
    assert after.position_world[2] < 0.1
    assert feet_over_ground(drone, STAIR, after).min() > -1e-3


def test_vehicle_stops_at_wall(drone):
    wall = relief(boxes=[(2.0, 0.0, 1.0, 9.0, 0.0, 3.0)])
    p = vehicle(drone, wall)
    highest, state = 0.0, dropped(p, (0.9, 0.0, HEIGHT), (2.0, 0.0, 0.0))
    energy = [0.5 * 4.0 + G * HEIGHT]
    for _ in range(40):
        state = run(p, state, 0.05)
        m = state.motion
        highest = max(highest, m.position_world[2])
        energy.append(0.5 * np.dot(m.velocity_world, m.velocity_world) + G * m.position_world[2])
    R = np.reshape(rotation_matrix(m.attitude), (3, 3))
    hull = np.array(m.position_world) + np.array(drone.contact.feet + drone.contact.hull) @ R.T
    assert hull[:, 0].max() < 1.5 + 1e-3
    assert highest < HEIGHT + 0.2
    assert max(energy) < energy[0] * (1.0 + 1e-3)


def test_vehicle_rests_on_pillar_and_falls_next_to_it(drone):
    pillar = relief(cylinders=[(0.0, 0.0, 0.4, 1.0)])
    p = vehicle(drone, pillar)
    on = run(p, dropped(p, (0.0, 0.0, 1.4), (0.0, 0.0, -0.3)), 3.0).motion
    assert still(on)
    assert on.position_world[2] == pytest.approx(1.0 + HEIGHT, abs=1e-4)
    beside = run(p, dropped(p, (0.9, 0.0, 1.4)), 3.0).motion
    assert beside.position_world[2] < 0.5
    assert math.hypot(*beside.position_world[:2]) > 0.3
