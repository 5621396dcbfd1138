"""Projection and partitioning of the five bodies: consistency, conservation of momentum, order of the integrator."""

import numpy as np
import pytest
from multibody_energy import energy
from test_five_bodies import scene

from lapwing.dynamics.integrators import get
from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.multibody.body_kinematics import add_increment
from lapwing.dynamics.multibody.five_bodies import BodyState, FiveBodies, arrays
from lapwing.dynamics.multibody.five_body_stabilisation import (
    NONE,
    PARTITION,
    PROJECTION,
    advance,
    constraint_violation,
    partition,
    project,
)
from lapwing.dynamics.multibody.mechanisms import drone_system
from lapwing.dynamics.multibody.stabilisation import project as general_project

METHOD = get("rk4_renormalised").Method()


def disturbed(x, size, rng):
    q, v = arrays(x)
    q, v = add_increment(q, size * rng.normal(size=(5, 6))), v + size * rng.normal(size=(5, 6))
    bodies = [
        BodyState(tuple(a[:3]), Quaternion(*a[3:]), tuple(b[:3]), tuple(b[3:]))
        for a, b in zip(q.tolist(), v.tolist(), strict=True)
    ]
    return FiveBodies(bodies[0], tuple(bodies[1:]))


def imposed(p):
    return np.array([[r.speed, r.drive] for r in p.rotors])


@pytest.mark.long
@pytest.mark.parametrize("driven", ["speed", "torque"])
def test_projection_equals_general_engine(driven):
    rng = np.random.default_rng(41)
    drone, p, x, *_ = scene(rng, driven)
    x = disturbed(x, 1e-5, rng)
    system = drone_system(drone, (driven == "speed",) * 4)
    drive = imposed(p) if driven == "speed" else np.zeros((0, 2))
    q, v = general_project(system.arrays, *arrays(x), drive, (1 << 30, 1 << 30))
    ours = arrays(project(p, 0.0, x))
    np.testing.assert_allclose(ours[0], q, atol=1e-9)  # one Newton step against Newton's iteration to its end
    np.testing.assert_allclose(ours[1], v, atol=1e-7)
    again = project(p, 0.0, project(p, 0.0, x))
    assert max(constraint_violation(p, again)) < 1e-12


@pytest.mark.long
@pytest.mark.parametrize("hold", [project, partition])
@pytest.mark.parametrize("driven", ["speed", "torque"])
def test_drift_is_removed_and_consistent_state_unchanged(hold, driven):
    rng = np.random.default_rng(42)
    _, p, x, *_ = scene(rng, driven)
    for a, b in zip(arrays(hold(p, 0.0, x)), arrays(x), strict=True):
        np.testing.assert_allclose(np.abs(a), np.abs(b), atol=1e-11)  # a quaternion's sign may change
    assert max(constraint_violation(p, disturbed(x, 1e-7, rng))) > 1e-8
    assert max(constraint_violation(p, hold(p, 0.0, disturbed(x, 1e-7, rng)))) < 1e-11


def test_projection_keeps_momentum():
    """Hinge impulses are internal: a velocity projection changes neither linear nor angular momentum."""
    rng = np.random.default_rng(43)
    drone, p, x, *_ = scene(rng, "torque")
    x = project(p, 0.0, x)
    off = FiveBodies(x.chassis._replace(velocity_world=(0.1, 0.2, -0.1)), x.propellers)
    masses = np.array([drone.mass, *drone.propeller_mass])
    before, after = arrays(off)[1], arrays(project(p, 0.0, off))[1]
    np.testing.assert_allclose(masses @ after[:, :3], masses @ before[:, :3], atol=1e-12)


@pytest.mark.long
@pytest.mark.parametrize("stabilisation", [NONE, PARTITION, PROJECTION])
def test_order_four_with_every_stabilisation(stabilisation):
    _, p, x, *_ = scene(np.random.default_rng(44), "torque")
    p = p._replace(rotors=tuple(r._replace(drive=0.01) for r in p.rotors))
    rotors = tuple(b._replace(omega_body=(*b.omega_body[:2], 0.1 * b.omega_body[2])) for b in x.propellers)
    x = partition(p, 0.0, FiveBodies(x.chassis, rotors))
    ends = [
        np.hstack(arrays(partition(p, 0.0, advance(METHOD, p, 0.0, x, 0.2 / n, n, stabilisation))))
        for n in (40, 80, 160, 2560)
    ]
    errors = [np.abs(np.abs(e) - np.abs(ends[-1])).max() for e in ends[:-1]]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > 3.7), orders


@pytest.mark.long
def test_energy_of_free_tumbling_drone_with_projection():
    drone, p, x, *_ = scene(np.random.default_rng(45), "torque")
    free = p._replace(
        gravity=(0.0, 0.0, 0.0),
        wrench=type(p.wrench)((0.0,) * 3, (0.0,) * 3),
        rotors=tuple(r._replace(drive=0.0, wrench=type(r.wrench)((0.0,) * 3, (0.0,) * 3)) for r in p.rotors),
    )
    system = drone_system(drone, (False,) * 4)
    before, _ = energy(system, *arrays(x))
    after, _ = energy(system, *arrays(advance(METHOD, free, 0.0, x, 1e-4, 5000, PROJECTION)))
    assert after == pytest.approx(before, rel=1e-7)
