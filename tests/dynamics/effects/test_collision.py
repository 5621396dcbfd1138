"""Collisions of spheres against Newton's law of impact and the conservation of momentum."""

from pathlib import Path

import numpy as np
import pytest

from lapwing.dynamics.effects import _vehicle_interaction as interaction
from lapwing.dynamics.effects import collision, from_scene
from lapwing.dynamics.integrators import get
from lapwing.dynamics.noise import stream_key
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.kernels import python_function

ROOT = Path(__file__).parents[3]
DRONE = load_airframe(ROOT / "lapwing/scenes/vehicles/delivery_drone.toml")
QUAD = load_airframe(ROOT / "lapwing/scenes/vehicles/quad_x.toml")
LIGHT = DRONE.model_copy(update={"mass": DRONE.mass.model_copy(update={"total": 1.5})})  # the same compiled plant
touch = python_function(collision.touch)
METHOD, KEY = get("rk4_renormalised").Method(), stream_key(1, "drone1", "plant")
H = 0.004  # [s] of an exchange interval


def bodies(*entries, restitution):
    """Return (parameters, state) of vehicles of 0.5 m radius in free space, each (airframe, position, velocity)."""
    result = []
    for frame, position, velocity in entries:
        e = from_scene({"collision": {"radius": 0.5, "restitution": restitution}}, frame)
        p = multirotor.parameters(frame, e)
        result.append((p, multirotor.initial_state(p, position, velocity_world=velocity)))
    return result


def fly(results, ticks):
    """Return the states after `ticks` ticks."""
    for tick in range(ticks):
        seen = [
            interaction.presence(p.effects)._replace(
                position_world=s.motion.position_world, velocity_world=s.motion.velocity_world, mass=p.body.mass
            )
            for p, s in results
        ]
        following = []
        for i, (p, s) in enumerate(results):
            others = tuple(seen[:i] + seen[i + 1 :])
            s = s._replace(memory=(touch(p.effects[0], s.memory[0], seen[i], others, H),))
            off = (0.0,) * len(p.layout.x_body)
            following.append((p, multirotor.advance(METHOD, p, KEY, tick, s, off, H / 4, 4)))
        results = following
    return results


def velocities(results):
    return np.array([s.motion.velocity_world for _, s in results])


def momentum(results):
    return sum(p.body.mass * np.array(s.motion.velocity_world) for p, s in results)


@pytest.mark.long
@pytest.mark.parametrize("restitution", [1.0, 0.5])
def test_central_impact_follows_newtons_law(restitution):
    meeting = (DRONE, (0.0, 0.0, 0.0), (2.0, 0.0, 0.0)), (LIGHT, (1.05, 0.0, 0.0), (-1.0, 0.0, 0.0))
    result = bodies(*meeting, restitution=restitution)
    m1, m2 = (p.body.mass for p, _ in result)
    after = velocities(fly(result, 50))[:, 0]
    together = (m1 * 2.0 - m2) / (m1 + m2)
    expected = together - restitution * m2 * 3.0 / (m1 + m2), together + restitution * m1 * 3.0 / (m1 + m2)
    assert after == pytest.approx(expected, rel=1e-12)


def test_impact_keeps_tangential_velocity_and_momentum():
    centres = 0.9 * np.array([0.8, 0.6, 0.0])
    moving, resting = (DRONE, (0.0, 0.0, 0.0), (3.0, 0.0, 0.5)), (LIGHT, tuple(centres), (0.0, 0.0, 0.0))
    result = bodies(moving, resting, restitution=1.0)
    flight = fly(result, 1)
    tangent = np.array([-0.6, 0.8, 0.0])
    assert velocities(flight) @ tangent == pytest.approx(velocities(result) @ tangent, abs=1e-12)
    assert velocities(flight)[:, 2] == pytest.approx([0.5, 0.0], abs=1e-12)
    assert momentum(flight) == pytest.approx(momentum(result), abs=1e-12)
    assert velocities(flight)[1] @ tangent == pytest.approx(0.0, abs=1e-12)


def test_simultaneous_collision_of_three_keeps_momentum():
    result = bodies(
        (DRONE, (-0.95, 0.1, 0.0), (2.0, 0.0, 0.0)),
        (LIGHT, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        (DRONE, (0.95, 0.0, 0.1), (-3.0, 0.0, 0.0)),
        restitution=0.3,
    )
    flight = fly(result, 500)
    assert momentum(flight) == pytest.approx(momentum(result), abs=1e-11)
    places = np.array([s.motion.position_world for _, s in flight])
    for i in range(3):
        for j in range(i):
            assert np.linalg.norm(places[i] - places[j]) > 0.99


def test_forces_on_pair_are_exactly_opposite():
    e = from_scene({"collision": {}}, DRONE)[0]
    one = interaction.NeighbourState((0.1, 0.2, 0.3), (1.0, 0.3, -0.2), mass=10.4, radius=0.5, restitution=0.4)
    other = interaction.NeighbourState((0.5, -0.3, 0.6), (-0.7, 0.1, 0.9), mass=1.5, radius=0.4, restitution=0.9)
    nothing = e.initial_discrete_state()
    force, torque = touch(e, nothing, one, (other,), H)
    assert force == tuple(-f for f in touch(e, nothing, other, (one,), H)[0])
    assert torque == (0.0, 0.0, 0.0)
    assert force[0] < 0.0 < force[1]


def test_sphere_reaches_rotor_tips():
    quad = from_scene({"collision": {}}, QUAD)[0]
    assert quad.radius == pytest.approx(np.linalg.norm([0.13, 0.22, 0.023]) + 0.128)


def ball(position, velocity, omega=(0.0, 0.0, 0.0), radius=0.5, mass=2.0, shape=0.4, friction=0.2, restitution=0.8):
    """Return a sphere of inertia shape m r^2; 2/5 is solid."""
    inverse = 1.0 / (shape * mass * radius**2)
    matrix = (inverse, 0.0, 0.0, 0.0, inverse, 0.0, 0.0, 0.0, inverse)
    values = {"mass": mass, "radius": radius, "restitution": restitution, "friction": friction}
    return interaction.NeighbourState(position, velocity, **values, omega_world=omega, inverse_inertia_world=matrix)


def after(one, other):
    """Return velocities and rates of both after the impulse."""
    e = from_scene({"collision": {"friction": 0.2}}, DRONE)[0]
    result = []
    for own, partner in ((one, other), (other, one)):
        force, torque = touch(e, e.initial_discrete_state(), own, (partner,), H)
        rate = own.inverse_inertia_world[0]
        velocity = np.array(own.velocity_world) + H * np.array(force) / own.mass
        result.append((velocity, np.array(own.omega_world) + H * rate * np.array(torque)))
    return result


@pytest.mark.parametrize("slip", [0.1, 0.7, 3.0])
def test_oblique_impact_follows_walton(slip):
    """Solid spheres: the tangential impulse is mu (1 + e) times the normal one, at most 2/7 of the slip's momentum."""
    one, other = ball((0.0, 0.0, 0.0), (1.0, slip, 0.0)), ball((1.0 - 1e-9, 0.0, 0.0), (0.0, 0.0, 0.0))
    (v1, w1), (v2, w2) = after(one, other)
    normal = 2.0 / 2.0 * 1.8 * 1.0  # m/2 (1 + e) u
    expected = min(0.2 * normal, 2.0 / 7.0 * 2.0 / 2.0 * slip)
    assert v1 == pytest.approx([1.0 - normal / 2.0, slip - expected / 2.0, 0.0], rel=1e-6)
    assert v2 == pytest.approx([normal / 2.0, expected / 2.0, 0.0], rel=1e-6)
    assert w1 == pytest.approx([0.0, 0.0, w2[2]])
    assert abs(w1[2]) == pytest.approx(expected * 0.5 / (0.4 * 2.0 * 0.25), rel=1e-6)
    left = v1[1] - v2[1] + 0.5 * (w1[2] + w2[2])  # slip at the contact
    assert left == pytest.approx(max(slip - 7.0 / 2.0 * 0.2 * normal / 1.0, 0.0), abs=1e-6)


def test_friction_keeps_momentum_and_angular_momentum():
    rng = np.random.default_rng(3)
    for _ in range(20):
        places = (0.0, 0.0, 0.0), tuple(0.8 * np.array([0.6, 0.0, 0.8]) + rng.normal(0.0, 0.05, 3))
        balls = [ball(p, tuple(rng.normal(0, 2, 3)), tuple(rng.normal(0, 9, 3)), shape=0.3) for p in places]
        balls[0] = balls[0]._replace(mass=5.0)
        moved = after(*balls)
        momentum = sum(b.mass * (v - b.velocity_world) for b, (v, _) in zip(balls, moved, strict=True))
        turning = sum(
            b.mass * np.cross(b.position_world, v - b.velocity_world) + (w - b.omega_world) / b.inverse_inertia_world[0]
            for b, (v, w) in zip(balls, moved, strict=True)
        )
        assert momentum == pytest.approx(np.zeros(3), abs=1e-12)
        assert turning == pytest.approx(np.zeros(3), abs=1e-12)


def test_friction_dissipates_energy_and_never_reverses_slip():
    rng = np.random.default_rng(4)
    for _ in range(20):
        velocity = tuple(rng.normal(0.0, 1.0, 3))
        one = ball((0.0, 0.0, 0.0), velocity, tuple(rng.normal(0.0, 5.0, 3)))
        other = ball((0.999, 0.0, 0.0), (0.0, 0.0, 0.0), tuple(rng.normal(0.0, 5.0, 3)))

        def energy(rows):
            return sum(0.5 * 2.0 * v @ v + 0.5 * 0.2 * w @ w for v, w in rows)

        def slip(rows):
            (v1, w1), (v2, w2) = rows
            return (v1 - v2 - np.cross(0.4995 * (w1 + w2), [-1.0, 0.0, 0.0]))[1:]

        before = [(np.array(b.velocity_world), np.array(b.omega_world)) for b in (one, other)]
        if velocity[0] < 0.3:
            continue  # they part, or are pushed apart by their depth
        moved = after(one, other)
        assert energy(moved) < energy(before)
        assert slip(moved) @ slip(before) >= -1e-9


def test_rough_vehicle_is_turned_by_glancing_impact():
    """The torque of the effect changes the body rates of the plant's vehicle."""
    e = from_scene({"collision": {"radius": 0.5, "friction": 0.5}}, QUAD)
    p = multirotor.parameters(QUAD, e)
    state = multirotor.initial_state(p, (0.0, 0.0, 0.0), velocity_world=(1.0, 2.0, 0.0))
    own = interaction.presence(p.effects)._replace(
        position_world=(0.0, 0.0, 0.0), velocity_world=(1.0, 2.0, 0.0), mass=p.body.mass,
        inverse_inertia_world=tuple(np.diag(p.body.inverse_inertia).ravel().tolist()),
    )  # fmt: skip
    other = own._replace(position_world=(0.95, 0.0, 0.0), velocity_world=(0.0, 0.0, 0.0))
    memory = touch(p.effects[0], state.memory[0], own, (other,), H)
    state = multirotor.advance(METHOD, p, KEY, 0, state._replace(memory=(memory,)), (0.0,) * 4, H / 4, 4)
    expected = memory[1][2] * H * p.body.inverse_inertia[2]
    assert expected != 0.0
    assert state.motion.omega_body == pytest.approx((0.0, 0.0, expected))
