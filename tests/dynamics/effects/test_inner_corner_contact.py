"""Contact in inner corners: continuous force, wedge friction, and energy of a drop without friction."""

import math

import numpy as np
import pytest

from lapwing.dynamics import effects
from lapwing.dynamics.effects import ground_contact
from lapwing.dynamics.effects._types import Motion
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.integrators import get
from lapwing.dynamics.lie.quaternion import NO_ROTATION, Quaternion, exp, rotation_matrix
from lapwing.dynamics.terrain import relief, touch
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.multirotor_equations import with_tolerance
from lapwing.kernels import kernel

pytestmark = pytest.mark.long

G = 9.80665
STEP = relief(steps=[(1.0, 0.2)])
ROOM = relief(boxes=[(2.0, 0.0, 2.0, 9.0, 0.0, 1.0), (0.0, 2.0, 9.0, 2.0, 0.0, 1.0)])
UPHILL, DOWNHILL = (relief((a, 0.1), boxes=[(2.0, 0.0, 2.0, 9.0, 0.0, 1.0)]) for a in (0.3, -0.3))


@kernel
def loads(e, memory, motion):
    return ground_contact.loads_and_stretching(e, memory, motion), ground_contact.forces(e, memory, motion)


def contact(drone, ground, **table):
    (e,) = effects.from_scene({"ground_contact": table}, drone, Environment(terrain=ground))
    return e._replace(feet=((0.0, 0.0, 0.0),) + ((0.0, 0.0, 1.0),) * 3)


def force_on_foot(e, place, velocity, deflection):
    motion = Motion(place, NO_ROTATION, velocity, (0.0, 0.0, 0.0), (0.0,) * 4)
    memory = (deflection, *((0.0, 0.0, 0.0),) * 3)
    return np.array(loads(e, memory, motion)[1][0][1])


def test_force_is_continuous_across_diagonal_of_corner(drone):
    """Equal depths in ground and wall: the force of the nearer face alone turned by 90 degrees there."""
    e = contact(drone, STEP)
    deflection, velocity = (1e-5, -2e-5, 3e-5), (0.02, 0.03, -0.04)
    for depth in (1e-5, 1e-4, 1e-3):
        forces = [
            force_on_foot(e, (1.0 + depth + shift, 0.0, -depth), velocity, deflection) for shift in (-1e-12, 1e-12)
        ]
        assert np.linalg.norm(forces[0]) > 1.0
        assert np.abs(forces[0] - forces[1]).max() < 1e-4


def test_slide_along_corner_has_friction_of_both_faces(drone):
    """Wedge friction: mu (N_ground + N_wall) along the corner, more than mu times the resultant."""
    e = contact(drone, STEP)
    behind, below = 3e-4, 4e-4
    for direction in (1.0, -1.0):
        force = force_on_foot(e, (1.0 + behind, 0.0, -below), (0.0, direction, 0.0), (0.0, 0.0, 0.0))
        normal = 1e6 * np.array((-behind, 0.0, below))
        expected = normal - (0.0, direction * 0.3 * 1e6 * (behind + below), 0.0)
        assert force == pytest.approx(expected, abs=1e-6)


def elastic_energy(depth, stiffness, width):
    """Return the integral of the normal force of eq. (2.12) without damping [J]."""
    x = min(depth, width) / width
    onset = stiffness * width**2 * (0.75 * x**4 - 0.4 * x**5)
    return onset + 0.5 * stiffness * (max(depth, width) ** 2 - width**2)


def total_energy(p, e, m):
    """Return kinetic, potential and elastic energy [J] of a vehicle."""
    R = np.reshape(rotation_matrix(m.attitude), (3, 3))
    result = 0.5 * p.body.mass * np.dot(m.velocity_world, m.velocity_world) + p.body.mass * G * m.position_world[2]
    result += 0.5 * np.dot(p.body.inertia, np.square(m.omega_body))
    for foot in e.feet:
        place = tuple(map(float, np.array(m.position_world) + R @ foot))
        depth = touch(e.terrain, place)[0]
        if depth > 0.0:
            result += elastic_energy(depth, e.stiffness, 1.0 / e.inverse_width)
    return result


@pytest.mark.parametrize("ground", [STEP, ROOM, UPHILL, DOWNHILL], ids=["step", "room", "uphill", "downhill"])
@pytest.mark.parametrize("damping", [0.0, 1e3])
def test_frictionless_drop_into_corner_gains_no_energy(drone, ground, damping):
    """A foot falls into the corner. Without damping the energy is constant."""
    table = {"friction_static": 0.0, "friction_dynamic": 0.0, "damping": damping}
    active = effects.from_scene({"gravity": {}, "ground_contact": table}, drone, Environment(terrain=ground))
    active = tuple(x._replace(feet=drone.contact.feet) if hasattr(x, "feet") else x for x in active)  # without hull
    p = multirotor.parameters(drone, active)
    e = next(x for x in p.effects if hasattr(x, "feet"))
    slope_x, slope_y = ground.slope
    attitude = Quaternion(*exp((0.0, 0.05 - math.atan(slope_x), 0.0)))
    feet = np.array(e.feet) @ np.reshape(rotation_matrix(attitude), (3, 3)).T
    corner = np.array((1.0, 1.0, slope_x + slope_y))
    velocity, t = np.array((0.7, 0.5, -0.5)), 0.02
    start = corner - feet[(feet[:, 0] + feet[:, 1]).argmax()] - velocity * t + (0.0, 0.0, 0.5 * G * t * t)
    state = multirotor.initial_state(p, tuple(start.tolist()), attitude, 0.0, tuple(velocity.tolist()))
    p = with_tolerance(p, 1e-13)
    energies, cornered = [total_energy(p, e, state.motion)], 0
    for _ in range(80):
        state = multirotor.advance(get("rk4_renormalised").Method(), p, (0, 0), 0, state, (0.0,) * 4, 5e-4, 2)
        energies.append(total_energy(p, e, state.motion))
        R = np.reshape(rotation_matrix(state.motion.attitude), (3, 3))
        places = np.array(state.motion.position_world) + np.array(e.feet) @ R.T
        touched = [touch(ground, tuple(map(float, place))) for place in places]
        cornered += any(depth > 0.0 and wedge > 1.01 for depth, _, wedge in touched)
    assert cornered >= 2
    scale = 0.5 * p.body.mass * 1.0
    assert max(energies) - energies[0] < 1e-8 * scale
    if damping == 0.0:
        assert min(energies) - energies[0] > -1e-8 * scale
