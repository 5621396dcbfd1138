"""Hard cases, each with a baseline that fails: pitch through 90 degrees, an hour of flight, light fast
propellers, locked, free and torn-off propellers, a redundant loop."""

import numpy as np
import pytest
from multibody_angles import euler_from_quaternion
from multibody_energy import energy
from test_augmented import PAPER
from test_delivery_drone import momentum, without_propeller

from lapwing.dynamics.integrators import get, integrate_fixed
from lapwing.dynamics.lie import quaternion
from lapwing.dynamics.multibody.augmented import ANY, RANK_TOLERANCE, accelerations, solve
from lapwing.dynamics.multibody.body_kinematics import add_increment
from lapwing.dynamics.multibody.delivery_drone import DroneState, Flight, Loads, delivery_drone
from lapwing.dynamics.multibody.five_bodies import BodyState, arrays, machine
from lapwing.dynamics.multibody.five_body_stabilisation import (
    NONE,
    PARTITION,
    PROJECTION,
    advance,
    assembled_state,
    constraint_violation,
)
from lapwing.dynamics.multibody.mechanisms import bricard, drone_system
from lapwing.dynamics.multibody.simulation import simulate

GRAVITY, NOWHERE = (0.0, 0.0, -9.81), (0.0, 0.0, 0.0)
ZERO4 = (0.0,) * 4
RENORMALISED, RKMK4 = get("rk4_renormalised").Method(), get("rkmk4").Method()


def five(drone, omega, speeds, gravity=GRAVITY, angles=(0.1, 0.4, 0.7, 1.0)):
    p = machine(drone, gravity, speeds=speeds)
    return p, assembled_state(p, BodyState(NOWHERE, quaternion.NO_ROTATION, NOWHERE, omega), angles, speeds)


@pytest.mark.long
def test_pitch_through_90_degrees():
    """Euler angles stop with a clear error on the pole; quaternions pass it. The baseline, which only checks for
    division by zero, passes the pole at a distance of 2e-3 rad silently, with a wrong result."""
    drone = delivery_drone(**PAPER)
    rate = 0.5 * np.pi / 0.2  # the pole exactly after 0.2 s
    _, x = five(drone, (0.0, rate, 0.0), ZERO4, angles=ZERO4)
    q, v = arrays(x)
    system = drone_system(drone, (False,) * 4)
    before = sum(energy(system, q, v))
    passed = simulate(system, q, v, 1e-3, 400, record_every=400)
    assert sum(energy(system, passed.configuration[-1], passed.velocity[-1])) == pytest.approx(before, abs=1e-8)
    angles, rates = euler_from_quaternion(q, v)
    with pytest.raises(ValueError, match=r"pitch reached 90 degrees at t = .* use quaternion coordinates"):
        simulate(system, angles, rates, 1e-3, 400, record_every=400)
    _, x = five(drone, (2e-3 * rate, rate, 0.0), ZERO4, angles=ZERO4)
    q, v = arrays(x)
    before = sum(energy(system, q, v))
    passed = simulate(system, q, v, 1e-3, 400, record_every=400)
    baseline = simulate(system, *euler_from_quaternion(q, v), 1e-3, 400, record_every=400)
    lost = [abs(sum(energy(system, m.configuration[-1], m.velocity[-1])) - before) for m in (passed, baseline)]
    assert lost[0] < 1e-8
    assert not lost[1] < 1e-3, lost


@pytest.mark.long
@pytest.mark.parametrize("stabilisation", [PARTITION, PROJECTION])
def test_hour_of_flight_stays_together(stabilisation):
    """In 3600 s of rotation with slow propellers the largest of 60 residuals is below 1e-10 on both levels."""
    p, x = five(delivery_drone(**PAPER), (0.3, 0.2, 0.5), (20.0, -20.0, 20.0, -20.0), NOWHERE)
    worst = (0.0, 0.0)
    for minute in range(60):
        x = advance(RENORMALISED, p, 60.0 * minute, x, 6e-3, 10000, stabilisation)
        worst = np.maximum(worst, constraint_violation(p, x))
    assert np.all(np.isfinite(np.hstack(arrays(x))))
    assert max(worst) < 1e-10, worst


def test_without_stabilisation_hour_drifts_apart():
    p, x = five(delivery_drone(**PAPER), (0.3, 0.2, 0.5), (20.0, -20.0, 20.0, -20.0), NOWHERE)
    drift = []
    for _ in range(3):
        x = advance(RENORMALISED, p, 0.0, x, 6e-3, 10000, NONE)
        drift.append(constraint_violation(p, x)[0])
    assert drift[0] > 1e-7
    assert drift[2] > 2.0 * drift[0] or not np.isfinite(drift[2])


def light():
    thousandth = tuple(1e-3 * i for i in PAPER["propeller_inertia"])
    return delivery_drone(**{**PAPER, "propeller_inertia": thousandth})


def test_light_propellers_at_1000_rad_per_s():
    """Inertia scaled by 1e-3, 1000 rad/s, steps of 1 ms: minimal coordinates remain accurate without smaller steps.

    The propellers' inertia does not make the equations stiff: it enters over the axial moment as an acceleration, only
    through torques. In the baseline, five bodies without stabilisation, the hinges are apart after 5 s.
    """
    drone, speeds = light(), (1000.0, -1000.0, 1000.0, -1000.0)
    x = DroneState(NOWHERE, quaternion.NO_ROTATION, NOWHERE, (1.0, -0.7, 0.4), (0.1, 0.4, 0.7, 1.0), speeds)
    flight = Flight(drone, Loads(NOWHERE, NOWHERE, ZERO4, ZERO4, ZERO4, NOWHERE))
    end = integrate_fixed(RKMK4, flight, 0.0, x, 1e-3, 20000)
    np.testing.assert_allclose(momentum(drone, end), momentum(drone, x), rtol=1e-5)
    fine = integrate_fixed(RKMK4, flight, 0.0, x, 1e-4, 200000)
    np.testing.assert_allclose(end.attitude, fine.attitude, atol=1e-3)
    p, baseline = five(drone, (1.0, -0.7, 0.4), speeds, NOWHERE)
    baseline = advance(RENORMALISED, p, 0.0, baseline, 1e-3, 5000, NONE)
    assert not max(constraint_violation(p, baseline)) < 1e-2


@pytest.mark.parametrize("driven", ["speed", "torque"])
def test_five_bodies_with_light_fast_propellers_stay_together(driven):
    p, x = five(
        delivery_drone(**{**PAPER, "propeller_inertia": (9.8e-9, 8.6e-7, 8.6e-7)}, driven=driven),
        (1.0, -0.7, 0.4),
        (1000.0, -1000.0) * 2,
    )
    for hold in (PARTITION, PROJECTION):
        end = advance(RENORMALISED, p, 0.0, x, 2.5e-4, 8000, hold)
        assert max(constraint_violation(p, end)) < 1e-9
        assert np.abs(end.chassis.omega_body).max() < 5.0


def test_locked_propeller_free_one_and_two_driven():
    """One flight has a propeller of each kind; the locked one turns with the chassis."""
    drone = delivery_drone(**PAPER)._replace(spins=(0.0, 1.0, 0.0, 0.0))
    x = DroneState(
        NOWHERE, quaternion.NO_ROTATION, NOWHERE, (0.2, 0.3, 0.1), (0.1, 0.4, 0.7, 1.0), (0.0, 50.0, 100.0, -100.0)
    )
    loads = Loads(NOWHERE, (0.1, 0.0, 0.05), ZERO4, ZERO4, (0.0, 0.0, 5.0, -5.0), GRAVITY)
    end = integrate_fixed(RKMK4, Flight(drone, loads), 0.0, x, 1e-3, 1000)
    assert end.speeds[0] == 0.0
    assert end.angles[0] == x.angles[0]
    np.testing.assert_allclose([end.speeds[2], end.speeds[3]], [105.0, -105.0], rtol=1e-12)
    # the same through the general engine: three drives, one free hinge
    system = drone_system(drone, (True, False, True, True))
    p = machine(drone, GRAVITY)
    q, v = arrays(assembled_state(p, BodyState(*x[:4]), x.angles, x.speeds))
    wrench = np.zeros((5, 6))
    wrench[0, 3:] = loads.torque_body
    drive = [[0.0, 0.0], [100.0, 5.0], [-100.0, -5.0]]
    motion = simulate(system, q, v, 1e-3, 1000, wrench=wrench, drive=drive, record_every=1000)
    np.testing.assert_allclose(motion.configuration[-1, 0, :3], end.position_world, atol=1e-7)
    np.testing.assert_allclose(motion.configuration[-1, 0, 3:], end.attitude, atol=1e-6)


def test_propeller_torn_off_in_flight():
    """The event removes a joint and a drive: both parts keep their momentum, the propeller as a free body."""
    drone = delivery_drone(**PAPER, driven="speed")
    speeds = (100.0, -100.0, 100.0, -100.0)
    _, x = five(drone, (0.5, -0.3, 0.8), speeds)
    system, drive = drone_system(drone), np.array([[s, 0.0] for s in speeds])
    before = simulate(system, *arrays(x), 5e-4, 200, drive=drive, record_every=200)
    q, v = before.configuration[-1], before.velocity[-1]
    broken = system.without("hinge 3").without("drive 3")
    after = simulate(broken, q, v, 5e-4, 400, drive=np.delete(drive, 2, 0), record_every=100)
    assert after.position_defect.max() < 1e-12
    # momentum of the whole falls with gravity alone; the free propeller's centre flies a parabola
    masses = broken.arrays.mass
    fallen = np.outer(after.time, masses.sum() * broken.arrays.gravity)
    np.testing.assert_allclose(
        np.einsum("b,sbc->sc", masses, after.velocity[:, :, :3]), masses @ v[:, :3] + fallen, atol=1e-10
    )
    t = after.time[:, None]
    parabola = q[3, :3] + t * v[3, :3] + 0.5 * t * t * broken.arrays.gravity
    np.testing.assert_allclose(after.configuration[:, 3, :3], parabola, atol=1e-12)
    # the chassis equals that of the plant after `without_propeller`
    lost = without_propeller(drone, 2)
    R0 = np.array(quaternion.rotation_matrix(tuple(q[0, 3:]))).reshape(3, 3)
    angles = tuple(
        float(
            np.arctan2((C := R0.T @ np.array(quaternion.rotation_matrix(tuple(q[b, 3:]))).reshape(3, 3))[1, 0], C[0, 0])
        )
        for b in range(1, 5)
    )
    start = DroneState(
        *(tuple(row) for row in (q[0, :3],)),
        quaternion.Quaternion(*q[0, 3:]),
        tuple(v[0, :3]),
        tuple(v[0, 3:]),
        angles,
        speeds,
    )
    flight = Flight(lost, Loads(NOWHERE, NOWHERE, ZERO4, ZERO4, ZERO4, GRAVITY))
    end = integrate_fixed(RKMK4, flight, 0.0, start, 5e-4, 400)
    np.testing.assert_allclose(end.position_world, after.configuration[-1, 0, :3], atol=1e-8)
    np.testing.assert_allclose(np.abs(end.attitude), np.abs(after.configuration[-1, 0, 3:]), atol=1e-6)


def test_rank_without_initial_bound_locks_bricard():
    """Off the constraints by 1e-6 the redundant row seems independent: the baseline finds no degree of freedom, and
    the mechanism does not move. With the initial rank as a bound it falls."""
    system, q, v = bricard()
    off = add_increment(q, 1e-6 * np.random.default_rng(1).normal(size=v.shape))
    no_load, no_drive = np.zeros((5, 6)), np.zeros((0, 2))
    baseline, _ = solve(system.arrays, off, v, no_load, no_drive, 0.0, 0.0, RANK_TOLERANCE, ANY)
    held, _ = solve(system.arrays, off, v, no_load, no_drive, 0.0, 0.0, RANK_TOLERANCE, 29)
    true = accelerations(system, q, v)
    assert (baseline.rank, held.rank, true.rank) == (30, 29, 29)
    assert np.abs(baseline.acceleration).max() < 1e-3
    np.testing.assert_allclose(held.acceleration, true.acceleration, atol=1e-3)
    assert np.abs(true.acceleration).max() > 1.0
