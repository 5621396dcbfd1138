"""Collisions of spheres against Newton's law of impact and the conservation of momentum."""

from pathlib import Path

import numpy as np
import pytest

from lapwing.dynamics.effects import _vehicle_interaction as interaction
from lapwing.dynamics.effects import from_scene
from lapwing.dynamics.effects.collision import touch
from lapwing.dynamics.integrators import get
from lapwing.dynamics.noise import stream_key
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.airframe import load_airframe

ROOT = Path(__file__).parents[3]
DRONE = load_airframe(ROOT / "lapwing/scenes/vehicles/delivery_drone.toml")
QUAD = load_airframe(ROOT / "lapwing/scenes/vehicles/quad_x.toml")
METHOD, KEY = get("rk4_renormalised").Method(), stream_key(1, "drone1", "plant")
H = 0.004  # [s] of an exchange interval


def bodies(*entries, restitution):
    """(parameters, state) of vehicles of 0.5 m radius in free space: (airframe, position, velocity) each."""
    found = []
    for frame, position, velocity in entries:
        e = from_scene({"collision": {"radius": 0.5, "restitution": restitution}}, frame)
        p = multirotor.parameters(frame, e)
        found.append((p, multirotor.initial_state(p, position, velocity_world=velocity)))
    return found


def fly(found, ticks):
    """The states after so many ticks, one tick of all after the other."""
    for tick in range(ticks):
        seen = [
            interaction.presence(p.effects)._replace(
                position_world=s.motion.position_world, velocity_world=s.motion.velocity_world, mass=p.body.mass
            )
            for p, s in found
        ]
        following = []
        for i, (p, s) in enumerate(found):
            others = tuple(seen[:i] + seen[i + 1 :])
            s = s._replace(memory=(touch(p.effects[0], s.memory[0], seen[i], others, H),))
            off = (0.0,) * len(p.layout.x_body)
            following.append((p, multirotor.advance(METHOD, p, KEY, tick, s, off, H / 4, 4)))
        found = following
    return found


def velocities(found):
    return np.array([s.motion.velocity_world for _, s in found])


def momentum(found):
    return sum(p.body.mass * np.array(s.motion.velocity_world) for p, s in found)


@pytest.mark.parametrize("restitution", [1.0, 0.5])
def test_head_on_it_is_newtons_law_of_impact(restitution):
    meeting = (DRONE, (0.0, 0.0, 0.0), (2.0, 0.0, 0.0)), (QUAD, (1.05, 0.0, 0.0), (-1.0, 0.0, 0.0))
    found = bodies(*meeting, restitution=restitution)
    m1, m2 = (p.body.mass for p, _ in found)
    after = velocities(fly(found, 50))[:, 0]
    together = (m1 * 2.0 - m2) / (m1 + m2)
    expected = together - restitution * m2 * 3.0 / (m1 + m2), together + restitution * m1 * 3.0 / (m1 + m2)
    assert after == pytest.approx(expected, rel=1e-12)


def test_across_the_line_of_centres_nothing_changes_and_momentum_is_kept():
    centres = 0.9 * np.array([0.8, 0.6, 0.0])
    found = bodies((DRONE, (0.0, 0.0, 0.0), (3.0, 0.0, 0.5)), (QUAD, tuple(centres), (0.0, 0.0, 0.0)), restitution=1.0)
    flown = fly(found, 1)
    tangent = np.array([-0.6, 0.8, 0.0])
    assert velocities(flown) @ tangent == pytest.approx(velocities(found) @ tangent, abs=1e-12)
    assert velocities(flown)[:, 2] == pytest.approx([0.5, 0.0], abs=1e-12)
    assert momentum(flown) == pytest.approx(momentum(found), abs=1e-12)
    assert velocities(flown)[1] @ tangent == pytest.approx(0.0, abs=1e-12)


def test_three_that_meet_at_once_keep_their_momentum_and_part():
    found = bodies(
        (DRONE, (-0.95, 0.1, 0.0), (2.0, 0.0, 0.0)),
        (QUAD, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        (DRONE, (0.95, 0.0, 0.1), (-3.0, 0.0, 0.0)),
        restitution=0.3,
    )
    flown = fly(found, 500)
    assert momentum(flown) == pytest.approx(momentum(found), abs=1e-11)
    places = np.array([s.motion.position_world for _, s in flown])
    for i in range(3):
        for j in range(i):
            assert np.linalg.norm(places[i] - places[j]) > 0.99


def test_the_forces_on_two_are_opposite_to_the_bit():
    e = from_scene({"collision": {}}, DRONE)[0]
    one = interaction.NeighbourState((0.1, 0.2, 0.3), (1.0, 0.3, -0.2), mass=10.4, radius=0.5, restitution=0.4)
    other = interaction.NeighbourState((0.5, -0.3, 0.6), (-0.7, 0.1, 0.9), mass=1.5, radius=0.4, restitution=0.9)
    force = touch(e, (0.0, 0.0, 0.0), one, (other,), H)
    assert force == tuple(-f for f in touch(e, (0.0, 0.0, 0.0), other, (one,), H))
    assert force[0] < 0.0 < force[1]


def test_the_sphere_reaches_to_the_rotors_tips():
    quad = from_scene({"collision": {}}, QUAD)[0]
    assert quad.radius == pytest.approx(np.linalg.norm([0.13, 0.22, 0.023]) + 0.128)
