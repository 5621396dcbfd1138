"""A propeller locks, turns freely or is torn off in flight without external loads: momenta are constant."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lapwing.dynamics import effects
from lapwing.dynamics.integrators import get
from lapwing.dynamics.lie.quaternion import exp, multiply, rotation_matrix
from lapwing.dynamics.vehicles import (
    multirotor,
    multirotor_equations,
    multirotor_euler,
    multirotor_multibody,
    multirotor_multibody_equations,
)
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.dynamics.vehicles.multirotor_equations import StepInputs
from lapwing.dynamics.vehicles.multirotor_multibody import BECOMES
from lapwing.dynamics.vehicles.multirotor_multibody_equations import joints
from lapwing.dynamics.vehicles.propeller_failures import Failure, advance_through
from lapwing.kernels import kernel
from tests.combinations import rest_nightly

pytestmark = pytest.mark.long

DRONE = load_airframe(Path(__file__).parents[3] / "lapwing/scenes/vehicles/delivery_drone.toml")
RK4 = get("rk4_renormalised").Method()
VOLTS, SPEED = (25.0, 27.0, 24.0, 28.0), 200.0
VELOCITY, OMEGA, ATTITUDE = (1.0, -2.0, 0.5), (0.6, -0.4, 0.3), exp((0.1, -0.2, 0.3))
FORMULATIONS = {"se3": multirotor_multibody, "euler": multirotor_euler}
H, N = 5e-4, 4
IZ = DRONE.rotors.inertia


@kernel
def on_se3(x):
    return multirotor_euler.five(x)


@kernel
def motion_from(p, x):
    return multirotor_equations.motion_of(p.layout, x)


@kernel
def apply_impulse(p, state, volts):
    return multirotor_multibody_equations.apply_constraint_impulse(
        StepInputs(p, p.body, state.memory, volts), state.motion
    )


@kernel
def apply_euler_impulse(p, state, volts):
    return multirotor_euler.apply_constraint_impulse(StepInputs(p, p.body, state.memory, volts), state.motion)


@kernel
def hinges(p, x, volts):
    return joints(StepInputs(p, p.body, (), volts), 0.0, x)


def bodies(x):
    x = x if hasattr(x, "chassis") else on_se3(x)
    return (x.chassis, *x.propellers)


def spin(p, b):
    """Return the angular momentum of each body about its centre of mass, in the world, shape (5, 3)."""
    d = p.layout.bodies.drone
    moments = np.array([d.inertia, *d.propeller_inertia])
    turned = [np.array(rotation_matrix(q.attitude)).reshape(3, 3) for q in b]
    return np.array([R @ (i * q.omega_body) for R, i, q in zip(turned, moments, b, strict=True)])


def momenta(p, x):
    """Return (linear, angular about the origin) momenta of the five bodies, shape (6,)."""
    d, b = p.layout.bodies.drone, bodies(x)
    masses = np.array([d.mass, *d.propeller_mass])
    linear = masses[:, None] * [q.velocity_world for q in b]
    angular = np.cross([q.position_world for q in b], linear) + spin(p, b)
    return np.concatenate([linear.sum(axis=0), angular.sum(axis=0)])


def fly(p, state, ticks, begin=0, volts=VOLTS, finer=1):
    for tick in range(begin, begin + ticks):
        state = multirotor.advance(RK4, p, (0, 0), tick, state, volts, H / finer, N * finer)
    return state


def before(coordinates, drive):
    formulation = FORMULATIONS[coordinates]
    p = formulation.parameters(DRONE, (), drive)
    start = formulation.initial_state(p, (0.0, 0.0, 0.0), ATTITUDE, SPEED, VELOCITY, OMEGA)
    return formulation, p, start, fly(p, start, 10)


@pytest.mark.parametrize("coordinates", FORMULATIONS)
@pytest.mark.parametrize("drive", rest_nightly("torque", "speed"))
@pytest.mark.parametrize("becomes", BECOMES)
def test_momentum_is_kept_across_event(coordinates, drive, becomes):
    formulation, p, start, state = before(coordinates, drive)
    after = formulation.with_propeller_failure(p, 1, becomes)
    kept = momenta(p, state.motion)
    assert np.abs(kept - momenta(p, start.motion)).max() < 1e-7
    if becomes == "locked":
        strike = apply_impulse if coordinates == "se3" else apply_euler_impulse
        state = state._replace(motion=strike(after, state, VOLTS))
        assert np.abs(momenta(after, state.motion) - kept).max() < 1e-11
    end = fly(after, state, 10, 10)
    assert np.abs(momenta(after, end.motion) - kept).max() < 1e-7


def test_locked_propeller_transfers_spin_to_chassis():
    """The baseline, which only stops the propeller, loses the spin."""
    _, p, _, state = before("se3", "torque")
    after = multirotor_multibody.with_propeller_failure(p, 1, "locked")
    speed = motion_from(p, state.motion).rotor_speed[1]
    motion = apply_impulse(after, state, VOLTS)
    assert motion_from(after, motion).rotor_speed[1] == pytest.approx(0.0, abs=1e-11)
    assert np.abs(np.subtract(motion.chassis.omega_body, state.motion.chassis.omega_body))[2] > 0.5 * IZ * speed / 0.5
    old = state.motion.propellers[1]
    still = old._replace(omega_body=(*old.omega_body[:2], state.motion.chassis.omega_body[2]))
    baseline = state.motion._replace(propellers=(state.motion.propellers[0], still, *state.motion.propellers[2:]))
    lost = np.linalg.norm((momenta(p, baseline) - momenta(p, state.motion))[3:])
    assert lost == pytest.approx(IZ * abs(speed), rel=1e-6)
    end = fly(after, state._replace(motion=motion), 20, 10).motion
    assert motion_from(after, end).rotor_speed[1] == pytest.approx(0.0, abs=1e-9)
    assert np.abs(motion_from(after, end).rotor_speed)[[0, 2, 3]].min() > SPEED


@pytest.mark.parametrize("drive", rest_nightly("torque", "speed"))
def test_free_propeller_keeps_its_spin_without_air(drive):
    """The baseline, a motor without voltage, brakes the propeller."""
    _, p, _, state = before("se3", drive)
    after = multirotor_multibody.with_propeller_failure(p, 1, "free")
    end = fly(after, state, 20, 10)
    axial = [bodies(x)[2].omega_body[2] for x in (state.motion, end.motion)]
    # uneven blades exchange a little of it with the body rates
    assert axial[1] == pytest.approx(axial[0], rel=1e-4)
    assert motion_from(after, end.motion).rotor_speed[3] > motion_from(after, state.motion).rotor_speed[3] + 10.0
    assert hinges(after, end.motion, VOLTS)[2][1][2] == pytest.approx(0.0, abs=1e-12)
    baseline = fly(p, state, 20, 10, (VOLTS[0], 0.0, *VOLTS[2:]))
    assert motion_from(p, baseline.motion).rotor_speed[1] < 0.8 * SPEED


@pytest.mark.parametrize(
    ("coordinates", "drive"), rest_nightly(("se3", "torque"), ("se3", "speed"), ("euler", "speed"))
)
def test_torn_off_propeller_has_no_constraint_rows(coordinates, drive):
    """The propeller flies straight and keeps its spin without a hinge force; the others are held. In the baseline,
    a propeller without thrust, it stays in its place."""
    formulation, p, _, state = before(coordinates, drive)
    after = formulation.with_propeller_failure(p, 1, "torn_off")
    if coordinates == "euler":
        arrays = after.layout.bodies.arrays
        assert (len(arrays.joint_bodies), len(arrays.drive_bodies)) == (3, 3)
    end = fly(after, state, 20, 10)
    t = 20 * N * H
    b, e = bodies(state.motion), bodies(end.motion)
    straight = np.array(b[2].position_world) + t * np.array(b[2].velocity_world)
    np.testing.assert_allclose(e[2].position_world, straight, atol=1e-12)
    np.testing.assert_allclose(spin(p, e)[2], spin(p, b)[2], atol=1e-7)
    assert motion_from(after, end.motion).rotor_speed[1] == 0.0
    if coordinates == "se3":
        forces = hinges(after, end.motion, VOLTS)
        assert forces[2] == ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        assert np.linalg.norm(forces[1][0]) > 0.0
    gap = [
        np.subtract(e[k + 1].position_world, e[0].position_world)
        - np.array(rotation_matrix(e[0].attitude)).reshape(3, 3) @ DRONE.rotors.position[k]
        for k in range(4)
    ]
    assert np.abs([gap[k] for k in (0, 2, 3)]).max() < 1e-10
    assert np.abs(gap[1]).max() > 1e-4
    baseline = bodies(fly(formulation.with_propeller_failure(p, 1, "free"), state, 20, 10).motion)
    assert np.abs(np.subtract(baseline[2].position_world, straight)).max() > 1e-4


def test_detachment_is_equal_in_both_coordinates():
    ends = []
    for coordinates in FORMULATIONS:
        formulation, p, _, state = before(coordinates, "torque")
        ends.append(bodies(fly(formulation.with_propeller_failure(p, 1, "torn_off"), state, 10, 10).motion))
    for one, other in zip(*ends, strict=True):
        np.testing.assert_allclose(one.position_world, other.position_world, atol=1e-8)
        np.testing.assert_allclose(rotation_matrix(one.attitude), rotation_matrix(other.attitude), atol=1e-5)


def test_detached_propeller_has_no_thrust():
    active = effects.from_scene({"gravity": {}, "rotor_thrust": {}}, DRONE)
    p = multirotor_multibody.with_propeller_failure(multirotor_multibody.parameters(DRONE, active), 1, "torn_off")
    state = multirotor_multibody.initial_state(p, (0.0, 0.0, 10.0), rotor_speed=SPEED)
    assert multirotor.observe(p, 0, H, state, VOLTS).thrust[1] == 0.0
    end = fly(p, state, 50)
    fallen = np.subtract(bodies(end.motion)[2].position_world, bodies(state.motion)[2].position_world)
    np.testing.assert_allclose(fallen, (0.0, 0.0, -0.5 * 9.80665 * (50 * N * H) ** 2), atol=1e-12)


FINER = 32  # times the steps, so that the reference sees the time of a failure, not the error of RK4
EFFECTS = effects.from_scene({"gravity": {}, "rotor_thrust": {}}, DRONE)


@kernel
def rate_of_bodies(p, x, memory, volts):
    return multirotor_multibody_equations.rate(StepInputs(p, p.body, memory, volts), 0.0, x)


def coordinates_of(x):
    return np.concatenate([np.concatenate(b) for b in (x.chassis, *x.propellers)])


def bodies_of(x, y):
    parts = [type(x.chassis)(*(tuple(part) for part in np.split(b, [3, 7, 10]))) for b in np.asarray(y).reshape(5, 13)]
    return type(x)(parts[0], tuple(parts[1:]))


def by_dop853(p, state, duration):
    """Return the bodies after `duration`, by SciPy from the tangent, with quaternions q' = q (0, omega)/2."""

    def rate(_, y):
        x = bodies_of(state.motion, y)
        tangent = rate_of_bodies(p, x, state.memory, VOLTS)
        change = []
        for b, d in zip((x.chassis, *x.propellers), (tangent.chassis, *tangent.propellers), strict=True):
            turned = 0.5 * np.array(multiply(b.attitude, (0.0, *b.omega_body)))
            change.append(np.concatenate([b.velocity_world, turned, d.velocity_world, d.omega_body]))
        return np.concatenate(change)

    y = solve_ivp(rate, (0.0, duration), coordinates_of(state.motion), "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    return state._replace(motion=bodies_of(state.motion, y))


@pytest.mark.parametrize("becomes", BECOMES)
def test_failures_between_ticks_equal_split_reference(becomes):
    """Propeller 2 fails between two steps and propeller 3 tears off 1.4 ms later, both within one tick of 2 ms."""
    p = multirotor_multibody.parameters(DRONE, EFFECTS, "torque")
    start = multirotor_multibody.initial_state(p, (0.0, 0.0, 0.0), ATTITUDE, SPEED, VELOCITY, OMEGA)
    first = multirotor_multibody.with_propeller_failure(p, 1, becomes)
    second = multirotor_multibody.with_propeller_failure(first, 2, "torn_off")
    times = [5 * H * N + moment for moment in (0.0003, 0.0017)]
    failures = (Failure(times[0], first, becomes == "locked"), Failure(times[1], second, False))
    state = fly(p, start, 5, finer=FINER)
    state = advance_through(RK4, p, failures, (0, 0), 5, state, VOLTS, H / FINER, N * FINER)
    state = fly(second, state, 4, 6, finer=FINER)
    expected = by_dop853(p, start, times[0])
    if becomes == "locked":
        expected = expected._replace(motion=apply_impulse(first, expected, VOLTS))
    expected = by_dop853(first, expected, times[1] - times[0])
    expected = by_dop853(second, expected, 10 * H * N - times[1])
    error = coordinates_of(state.motion) - coordinates_of(expected.motion)
    assert np.abs(error).max() < 1e-9


def test_failure_at_tick_equals_failure_between_runs():
    """The result is bit-for-bit that of a plant without failures that starts at the tick."""
    p = multirotor_multibody.parameters(DRONE, EFFECTS, "torque")
    state = fly(p, multirotor_multibody.initial_state(p, (0.0, 0.0, 0.0), ATTITUDE, SPEED, VELOCITY, OMEGA), 3)
    after = multirotor_multibody.with_propeller_failure(p, 1, "locked")
    expected = fly(after, state._replace(motion=apply_impulse(after, state, VOLTS)), 1, 3)
    for time in (0.0, 3 * H * N * (1.0 + 1e-12)):
        failures = (Failure(time, after, True),)
        assert advance_through(RK4, p, failures, (0, 0), 3, state, VOLTS, H, N) == expected
