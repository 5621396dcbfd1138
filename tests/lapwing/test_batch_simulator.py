"""Batches of vehicles: bit-for-bit equality with single vehicles, resets, parameters per member, body rates."""

import re

import numpy as np
import pytest

import lapwing
from lapwing.api.batch_members import terrain_of
from lapwing.dynamics import simd_batch as kernels
from lapwing.dynamics.terrain import surface
from lapwing.dynamics.vehicles import multirotor
from lapwing.kernels import kernel
from lapwing.kernels.row_packing import pack_row
from lapwing.services.scene_resolver import load, resolve
from tests.combinations import rest_nightly

pytestmark = pytest.mark.long

N = 19  # more than a block, less than two
LOADED = ["effects.shared_slung_load.mass=1.0", "effects.shared_slung_load.length=1.0"]
MISSION = "delivery_mission"  # random wind, ground contact, air density
HILL = {"environment.terrain.slope": [0.25, 0.0]}
STAIRS = {"environment.terrain.steps.distance": [0.3, 0.9], "environment.terrain.steps.rise": [0.15, -0.1]}
VARY = {"vehicle.mass": lapwing.normal(10.4, 0.3), "effects.random_wind_force.sigma": lapwing.uniform(0.0, 2.0)}


@kernel
def step_alone(method, p, key, state, command, h, n, ticks):
    for tick in range(ticks):
        state = multirotor.advance(method, p, key, tick, state, command, h, n)
    return state


@pytest.fixture(scope="module")
def batch():
    return lapwing.BatchSimulator(MISSION, N, VARY, seed=5)


def alone(k, volts, ticks, start=None):
    """Return the motion of member k after `ticks` ticks, simulated alone."""
    from lapwing.studies.campaign.plan import plan

    values = plan(MISSION, (), N, 5, VARY).overrides_of(k)
    plant = resolve(load(MISSION, values)).services["plant"].parameters
    core, state = plant.core, plant.start.vehicle
    if start is not None:
        state = state._replace(motion=state.motion._replace(position_world=start))
    return pack_row(step_alone(core.method, core.vehicle, core.key, state, volts, core.step, core.steps, ticks).motion)


def test_members_are_stepped_in_vector_registers(batch):
    batch.reset()
    batch.step(motor_voltages=np.full((N, 4), 31.0))
    for compiled in kernels.advance.overloads.values():
        assert re.search(r"fmul <\d+ x double>", str(compiled.library._get_module_for_linking()))


def rows(state):
    return np.column_stack(state[1:6])


def test_every_member_is_bit_for_bit_single_vehicle(batch):
    batch.reset()
    volts = np.linspace(31.0, 35.0, 4 * N).reshape(N, 4)  # some stay on the ground, some take off
    end = batch.step(motor_voltages=volts, ticks=125)
    assert end.position_world[:, 2].min() < 0.351 < 0.4 < end.position_world[:, 2].max()
    assert np.all(end.time == 125 * batch.interval)
    for k in (0, 7, 15, 16, 18):
        assert np.array_equal(rows(end)[k], alone(k, tuple(volts[k]), 125))


LIMITS = [  # scene, overrides, voltages, speeds of the rotors of each member
    ("hexacopter_tilted", [], (4.0, 5.0, 3.0, 6.0, 4.5, 5.5), [400.0] * 3),
    *(
        ("hover", [f"effects.{effect}"], (28.0, 31.0, 30.0, 33.0), [310.0, 335.0, 150.0])
        for effect in ("dc_motor={inductance=5e-5}", "dc_motor={}", "dynamic_inflow={}")
    ),
]


@pytest.mark.parametrize(("scene", "overrides", "volts", "speeds"), rest_nightly(*LIMITS, keep=2))
def test_limits_of_inflow_motors_and_flow_are_bit_for_bit_single_vehicle(scene, overrides, volts, speeds):
    """Two of three members reach a limit, whose steps have error control."""
    batch, ticks, climb, rotors = (
        lapwing.BatchSimulator(scene, 3, overrides=overrides),
        25,
        (0.0, 6.0, -6.0),
        len(volts),
    )
    start = {"position_world": (0.0, 0.0, 50.0), "rotor_speed": np.repeat(speeds, rotors).reshape(3, rotors)}
    batch.reset(**start, velocity_world=[(0.0, 0.0, v) for v in climb])
    end = batch.step(motor_voltages=np.tile(volts, (3, 1)), ticks=ticks)
    plant = resolve(load(scene, overrides)).services["plant"].parameters
    core, state = plant.core, plant.start.vehicle
    for k, v in enumerate(climb):
        motion = state.motion._replace(
            position_world=(0.0, 0.0, 50.0), velocity_world=(0.0, 0.0, v), rotor_speed=(speeds[k],) * rotors
        )
        one = state._replace(motion=motion)
        one = step_alone(core.method, core.vehicle, core.key, one, volts, core.step, core.steps, ticks)
        assert np.array_equal(rows(end)[k], pack_row(one.motion))


def test_members_are_reset_independently(batch):
    first = batch.reset()
    volts = np.full((N, 4), 33.0)
    after = batch.step(motor_voltages=volts, ticks=30)
    mixed = batch.reset([3, 17], position_world=(1.0, 2.0, 5.0))
    assert np.array_equal(np.delete(rows(mixed), [3, 17], axis=0), np.delete(rows(after), [3, 17], axis=0))
    assert (mixed.time[3], mixed.time[4]) == (0.0, 30 * batch.interval)
    assert mixed.position_world[[3, 17]].tolist() == [[1.0, 2.0, 5.0]] * 2
    end = batch.step(motor_voltages=volts, ticks=20)
    for k in (3, 17):
        assert np.array_equal(rows(end)[k], alone(k, (33.0,) * 4, 20, (1.0, 2.0, 5.0)))
    assert np.array_equal(rows(batch.reset()), rows(first))


def test_body_rates_are_followed_and_thrust_holds_weight():
    batch = lapwing.BatchSimulator("hover", 4)
    batch.reset(position_world=(0.0, 0.0, 50.0), rotor_speed=np.full(4, 330.0))
    expected = np.array([[0.5, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.3], [0.0, 0.0, 0.0]])
    weight = load("hover").lookup("airframe.mass").total * 9.80665
    end = batch.step(thrust=np.full(4, weight), body_rates=expected, ticks=150)
    assert end.omega_body == pytest.approx(expected, abs=0.02)
    assert abs(end.velocity_world[3, 2]) < 0.5


def test_body_rate_control_equals_voltages_computed_in_numpy():
    """The reference in numpy: torque, allocation by least squares, inverse of thrust = k speed^2, speed = u KV."""
    one, other = (lapwing.BatchSimulator("hover", 3) for _ in range(2))
    for batch in (one, other):
        batch.reset(position_world=(0.0, 0.0, 50.0), rotor_speed=one.hover_speed, omega_body=(0.4, -0.3, 0.2))
    a = one._nominal_airframe
    inertia, x, y, z = np.array(a.inertia_body), a.rotor_x, a.rotor_y, np.array(a.reaction_sign) * a.torque_per_thrust
    effect = np.array([np.ones(4), y, -np.array(x), z])  # effect of a rotor's thrust on thrust and torques
    thrust, rates = (
        one.weight * np.array([0.9, 1.0, 1.1]),
        np.array([[0.5, 0.0, 0.1], [0.0, 0.5, 0.0], [1.0, 1.0, 0.0]]),
    )
    for _ in range(10):
        one.step(thrust=thrust, body_rates=rates)
        omega = other.state.omega_body
        torque = inertia * 15.0 * (rates - omega) + np.cross(omega, inertia * omega)
        each = np.linalg.solve(effect, np.column_stack([thrust, torque]).T).T
        speed = np.sqrt(each / a.motor.thrust_coefficient)
        volts = speed * 60.0 / (2.0 * np.pi) / (a.motor.gear_ratio * a.motor.speed_constant)
        other.step(motor_voltages=np.clip(volts, 0.0, a.voltage_max))
    assert rows(one.state) == pytest.approx(rows(other.state), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        (lambda b: lapwing.BatchSimulator("hover", 0), "n: expected a whole number of members, at least 1, got 0"),
        (lambda b: lapwing.BatchSimulator("hover", "many"), "n: expected a whole number of members, .* got 'many'"),
        (
            lambda b: lapwing.BatchSimulator("gyrostat_chaotic", 2),
            'expected "rigid_body", the only one that batches step',
        ),
        (lambda b: lapwing.BatchSimulator("hover", 2, overrides=LOADED), "effects.shared_slung_load: .*carried loads"),
        (lambda b: b.step(), "step: expected motor_voltages, or thrust and body_rates"),
        (lambda b: b.step(thrust=np.zeros(N)), "step: expected motor_voltages, or thrust and body_rates"),
        (lambda b: b.step(np.zeros((N, 3))), r"motor_voltages: expected numbers of shape \(19, 4\), got \(19, 3\)"),
        (lambda b: b.step(np.full((N, 4), np.nan)), "motor_voltages: expected finite numbers"),
        (lambda b: b.step(np.zeros((N, 4)), ticks=0), "step: expected ticks = 1, 2"),
        (lambda b: b.reset([19]), "members: expected numbers from 0 to 18"),
        (lambda b: b.reset(attitude=(0.0, 0.0, 0.0, 0.0)), "attitude: expected unit quaternions"),
        (lambda b: b.reset(position_world=(0.0, 0.0, -5.0)), "position_world: expected a centre of mass above the"),
        (lambda b: b.reset(rotor_speed=np.full(4, -300.0)), "rotor_speed: expected speeds of at least 0 rad/s"),
        (lambda b: b.reset(position_world=(1.0, 2.0)), r"position_world: .* shape \(19, 3\), got \(2,\)"),
        (lambda b: b.reset(velocity_world=(np.nan, 0.0, 0.0)), "velocity_world: expected finite numbers"),
        (
            lambda b: lapwing.BatchSimulator("hover", 1, overrides=HILL).reset(position_world=(3.0, 0.0, 0.6)),
            "position_world: expected a centre of mass above the ground",
        ),
        (lambda b: b.reset([1], speed=1.0), "speed: unknown; expected one of position_world, attitude"),
    ],
)
def test_batch_errors_are_one_line(batch, wrong, text):
    with pytest.raises(ValueError, match=text):
        wrong(batch)


def test_member_that_turns_too_fast_is_marked():
    batch = lapwing.BatchSimulator("hover", 3)
    batch.reset(position_world=(0.0, 0.0, 50.0))
    batch.reset([1], position_world=(0.0, 0.0, 50.0), omega_body=(1e7, 0.0, 0.0))
    assert batch.step(motor_voltages=np.zeros((3, 4))).valid.tolist() == [True, False, True]
    with pytest.raises(ValueError, match="step: members 1 are not finite or turn too fast"):
        batch.step(motor_voltages=np.zeros((3, 4)), strict=True)
    assert batch.reset([1]).valid.all()


def test_member_with_non_finite_number_is_marked():
    batch = lapwing.BatchSimulator("hover", 3)
    for value in (np.nan, np.inf, -np.inf):
        for column in range(batch._motion):
            batch.reset(position_world=(0.0, 0.0, 50.0))
            batch._blocks[0, column, 2] = value
            assert batch.step(motor_voltages=np.zeros((3, 4))).valid.tolist() == [True, True, False]


@pytest.mark.parametrize("ground", ["slope", "bumps", "steps", "box and cylinder", "grid", "rotor table"])
def test_members_over_any_terrain_are_bit_for_bit_single_vehicle(ground):
    """The members drop onto different places, some on an edge or beside it."""
    overrides = {
        "slope": HILL,
        "bumps": {"environment.terrain.bump_height": 0.05, "environment.terrain.bump_length": 0.7},
        "steps": STAIRS,
        "box and cylinder": {
            "environment.terrain.box": [{"position": [0.5, 0.2], "size": [0.6, 0.4], "top": 0.3, "heading": 0.4}],
            "environment.terrain.cylinder": [{"position": [-0.6, 0.0], "radius": 0.3, "top": 0.2}],
        },
        "grid": {
            "environment.terrain.grid.heights": [[0.0, 0.1, 0.3], [0.1, 0.0, 0.2], [0.0, 0.3, 0.1]],
            "environment.terrain.grid.corner": [-1.0, -1.0],
        },
        "rotor table": {"effects.rotor_interference": {}},
    }[ground]
    batch = lapwing.BatchSimulator("hover", N, overrides=overrides, seed=3)
    starts = np.column_stack([np.linspace(-1.0, 1.0, N), np.linspace(-0.2, 0.3, N), np.full(N, 0.9)])
    batch.reset(position_world=starts, velocity_world=(0.3, 0.0, -1.0))
    end = batch.step(motor_voltages=np.zeros((N, 4)), ticks=100)
    assert end.valid.all()
    plant = resolve(load("hover", overrides)).services["plant"].parameters
    core = plant.core
    for k in (0, 7, 15, 18):
        motion = plant.start.vehicle.motion._replace(
            position_world=tuple(starts[k].tolist()), velocity_world=(0.3, 0.0, -1.0)
        )
        state, key = plant.start.vehicle._replace(motion=motion), tuple(map(int, batch._keys[k]))
        one = step_alone(core.method, core.vehicle, key, state, (0.0,) * 4, core.step, core.steps, 100)
        assert np.array_equal(rows(end)[k], pack_row(one.motion))
    heights = np.array([surface(terrain_of(core), x, y)[0] for x, y, _ in end.position_world])
    assert (end.position_world[:, 2] > heights).all()


def test_bumps_of_members_differ():
    vary = {"environment.terrain.bump_height": lapwing.uniform(0.01, 0.3)}
    batch = lapwing.BatchSimulator("hover", 3, vary, {"environment.terrain.bump_length": 4.0})
    batch.reset(position_world=(1.0, 1.0, 2.0))  # on the summit of a bump
    end = batch.step(motor_voltages=np.zeros((3, 4)), ticks=400)
    assert len({round(float(z), 3) for z in end.position_world[:, 2]}) == 3


def test_members_share_tables_of_numbers():
    vary = {"environment.terrain.steps.rise.0": lapwing.uniform(0.1, 0.2)}
    with pytest.raises(ValueError, match=r"member 1: has other numbers in terrain.boxes than member 0"):
        lapwing.BatchSimulator("hover", 2, vary, STAIRS)


def test_solver_is_selected_from_accuracy():
    batch = lapwing.BatchSimulator("hover", 1, overrides={"solver.accuracy": 1e-4})
    assert batch.step(motor_voltages=np.zeros((1, 4))).valid.all()
    with pytest.raises(ValueError, match=r"solver.accuracy: expected a number at least 1e-12"):
        lapwing.BatchSimulator("hover", 1, overrides={"solver.accuracy": 1e-20})
