"""Winds: constant, gusts, boundary layer, random force."""

import math

import numpy as np
import pytest
from scipy.signal import welch

from lapwing.dynamics import effects
from lapwing.dynamics.effects._wind_use import uses_wind
from lapwing.dynamics.effects.random_wind_force import draw, random_wind_force, reported_wind
from lapwing.dynamics.effects.wind_boundary_layer import wind_boundary_layer
from lapwing.dynamics.effects.wind_constant import WindConstant, wind_constant
from lapwing.dynamics.effects.wind_gust import WindGust, edges, wind_gust
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.noise import stream_key
from lapwing.dynamics.terrain import LEVEL, relief
from lapwing.dynamics.vehicles import multirotor
from lapwing.kernels import kernel
from tests.commands import run_command


@pytest.mark.usefixtures("uncompiled")
def test_uniform_wind_is_added(situation):
    s = situation(wind=(1, 0, 0), density=1.1)
    assert wind_constant.py_func(WindConstant((2.0, -1.0, 0.5)), (), s, s.air) == (1.1, (3.0, -1.0, 0.5))


@pytest.mark.usefixtures("uncompiled")
def test_every_aerodynamic_effect_feels_motion_of_air(drone):
    """Rest in wind equals flight against it in still air for drag, H-force and inflow (Galileo)."""
    tables = {"rotor_thrust": {}, "axial_inflow": {}, "body_drag": {}, "h_force": {}}
    wind = (4.0, -2.0, 1.0)
    still = multirotor.parameters(drone, effects.from_scene(tables, drone))
    windy = multirotor.parameters(drone, effects.from_scene({**tables, "wind_constant": {"velocity": wind}}, drone))
    start = {"position_world": (0.0, 0.0, 20.0), "rotor_speed": 330.0, "omega_body": (0.5, -0.3, 0.2)}
    against = tuple(-v for v in wind)
    one = multirotor.observe(windy, 0, 0.004, multirotor.initial_state(windy, **start), (32.0,) * 4)
    other = multirotor.observe(
        still, 0, 0.004, multirotor.initial_state(still, **start, velocity_world=against), (32.0,) * 4
    )
    assert one.acceleration_world == pytest.approx(other.acceleration_world, abs=1e-12)
    assert one.angular_acceleration_body == pytest.approx(other.angular_acceleration_body, abs=1e-11)
    assert one.motor_power == pytest.approx(other.motor_power)
    assert one.acceleration_world[0] > 0.1


ALONE = ["axial_inflow", "body_drag", "dynamic_inflow", "gravity", "ground_effect", "gyroscopic_torque", "h_force",
         "random_wind_force", "rotor_flapping", "rotor_interference"]  # fmt: skip


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("name", ALONE)
def test_effect_uses_wind_if_it_changes_an_acceleration(drone, name):
    accelerations = []
    for velocity in ((0.0, 0.0, 0.0), (4.0, -2.0, 1.0)):
        tables = {"rotor_thrust": {}, name: {}, "wind_constant": {"velocity": velocity}}
        p = multirotor.parameters(drone, effects.from_scene(tables, drone))
        x = multirotor.initial_state(p, position_world=(0.0, 0.0, 2.0), rotor_speed=330.0, omega_body=(0.5, -0.3, 0.2))
        o = multirotor.observe(p, 0, 0.004, x, (32.0,) * 4)
        accelerations.append((*o.acceleration_world, *o.angular_acceleration_body))
    assert any(map(uses_wind, p.effects)) == (accelerations[0] != accelerations[1])


WINDY = ("hover", "--set", "effects.wind_constant.velocity=[3, 0, 0]")


@pytest.mark.parametrize(("more", "warns"), [((), True), (("--set", "effects.body_drag={}"), False)])
def test_check_warns_of_a_wind_that_no_effect_uses(more, warns):
    text = "effects.wind_constant does not move the vehicle: no effect of the scene uses it; add body_drag"
    assert (f"lapwing: warning: {text}" in run_command("check", *WINDY, *more, code=0).stderr) == warns


GUST = WindGust((4.0, 0.0, -2.0), 1.0, 2.0)


@pytest.mark.parametrize(("t", "part"), [(0.5, 0), (1.0, 0), (1.5, 0.5), (2.0, 1), (2.5, 0.5), (3.0, 0), (4.0, 0)])
def test_one_minus_cosine(situation, t, part):
    s = situation(t=t)
    wind = wind_gust.py_func(GUST, (), s, s.air).wind_world
    assert wind == pytest.approx((4.0 * part, 0.0, -2.0 * part), abs=1e-12)


@pytest.mark.parametrize(
    ("t", "h", "following"),
    [
        (0.0, 0.001, 1.0),
        (1.0, 0.001, 3.0),
        (3.0, 0.001, math.inf),
        (1.0, 0.2, 1.125),
        (1.2, 0.2, 1.25),
        (3.0, 0.2, math.inf),
    ],
)
def test_break_times_are_edges_and_parts_of_short_gust(t, h, following):
    assert edges.py_func(GUST, (), t, h, math.inf) == pytest.approx(following)
    assert edges.py_func(GUST, (), t, h, 0.5) == 0.5


TABLE = {"speed": 8.0, "height": 10.0, "roughness": 0.1, "direction_to": math.pi / 2}
HILL, ROOF = relief(slope=(0.1, 0.0)), relief(boxes=[(0.0, 0.0, 500.0, 500.0, 0.0, 3.0)])


@pytest.mark.parametrize(("terrain", "ground"), [(LEVEL, 0.0), (HILL, 2.0), (ROOF, 3.0)])
def test_wind_is_logarithmic_in_height_over_ground(drone, situation, terrain, ground):
    (e,) = effects.from_scene({"wind_boundary_layer": TABLE}, drone, Environment(terrain=terrain))

    def wind(height):
        s = situation(position=(20.0, 5.0, ground + height))
        return wind_boundary_layer.py_func(e, (), s, s.air).wind_world

    assert wind(10.0) == pytest.approx((0.0, 8.0, 0.0), abs=1e-9)
    assert wind(0.0) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    assert wind(-1.0)[1] == 0.0
    # friction velocity over von Karman's constant at every height: u = a ln(1 + z / z0)
    for height in (0.5, 3.0, 60.0):
        assert wind(height)[1] / math.log1p(height / 0.1) == pytest.approx(8.0 / math.log(101.0), rel=1e-6)


WIND = {"mean": [3.0, 1.0, 0.0], "sigma": 0.7}
KEY = stream_key(3, "drone1", "effects")


def make(drone, **table):
    (e,) = effects.from_scene({"random_wind_force": {**WIND, **table}}, drone)
    return e


def test_force_of_steady_wind_follows_source_formula(drone, situation, rotors):
    e = make(drone, sigma=0.0)
    s = situation(velocity=(1, 1, 0))
    memory = draw.py_func(e, e.initial_discrete_state(), s, rotors(), KEY, 0, 0.004)
    force, torque = random_wind_force.py_func(e, memory, s, rotors())
    assert force == pytest.approx((0.5 * 1.0 * 0.06 * 1.22 * 2.0**2, 0.0, 0.0))
    assert torque == (0.0, 0.0, 0.0)


def test_draws_have_mean_and_deviation(drone, situation, rotors):
    """The draws of the wind are recovered from the force F = k |v| v."""
    e, s = make(drone), situation()
    forces = np.array([draw.py_func(e, (), s, rotors(), KEY, tick, 0.004)[0] for tick in range(2000)])
    size = np.linalg.norm(forces, axis=1, keepdims=True)
    wind = forces / np.sqrt(size * 0.5 * 0.06 * 1.22)
    assert wind.mean(axis=0) == pytest.approx((3.0, 1.0, 0.0), abs=4 * 0.7 / np.sqrt(2000))
    assert wind.std(axis=0) == pytest.approx((0.7,) * 3, rel=0.07)


def test_force_depends_on_tick_and_key_only(drone, situation, rotors):
    e, s = make(drone), situation()
    other = ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
    one = draw.py_func(e, other, s, rotors(), KEY, 7, 0.004)
    assert one == draw.py_func(e, e.initial_discrete_state(), s, rotors(), KEY, 7, 0.004)
    assert one != draw.py_func(e, e.initial_discrete_state(), s, rotors(), KEY, 8, 0.004)
    assert one != draw.py_func(e, e.initial_discrete_state(), s, rotors(), stream_key(4, "drone1", "effects"), 7, 0.004)


def test_wind_of_force_is_reported(drone, situation, rotors):
    """The reported wind is that of the force."""
    e, s = make(drone), situation(velocity=(1, 1, 0))
    memory = draw.py_func(e, e.initial_discrete_state(), s, rotors(), KEY, 5, 0.004)
    wind = np.array(reported_wind.py_func(e, memory, (0.5, 0.0, 0.0))) - (0.5, 0.0, 0.0)
    past = wind - (1.0, 1.0, 0.0)
    assert memory[0] == pytest.approx(0.5 * 0.06 * 1.22 * np.linalg.norm(past) * past)


@kernel
def series(e, memory, s, rotors, key, interval, out):
    for tick in range(out.shape[0]):
        memory = draw(e, memory, s, rotors, key, tick, interval)
        force, wind = memory
        out[tick, 0], out[tick, 1] = force[0], wind[0]


def test_spectrum_does_not_depend_on_exchange_interval(drone, situation, rotors):
    """Wind and force (linearised about the mean) have the two-sided density sigma^2 T below the draw frequency."""
    e, densities, means = make(drone), [], []
    for interval in (0.001, 0.004, 0.01, 0.02):
        out = np.empty((round(800.0 / interval), 2))
        series(e, e.initial_discrete_state(), situation(), rotors(), KEY, interval, out)
        frequency, power = welch(out, fs=1 / interval, nperseg=round(4.0 / interval), axis=0)
        densities.append(power[(frequency > 0.5) & (frequency < 10.0)].mean(axis=0) / 2)
        means.append(out[:, 0].mean())
    assert np.array(densities)[:, 1] == pytest.approx([0.7**2 * 0.004] * 4, rel=0.05)
    assert np.array(densities)[:, 0] == pytest.approx([densities[1][0]] * 4, rel=0.05)
    assert means == pytest.approx([means[1]] * 4, rel=0.01)


def test_short_ticks_share_draws_and_long_ticks_average_them(drone, situation, rotors):
    e, start = make(drone), make(drone).initial_discrete_state()

    def at(tick, interval, memory=start, velocity=(0.0, 0.0, 0.0)):
        return draw.py_func(e, memory, situation(velocity=velocity), rotors(), KEY, tick, interval)

    first = at(28, 0.001)
    assert first == at(7, 0.004)
    assert first == at(31, 0.001, first, velocity=(2.0, 0.0, 0.0))  # the force of the draw's start
    assert at(32, 0.001, first) == at(8, 0.004)
    parts = [np.array(at(tick, 0.004)) for tick in (2, 3, 4)]
    assert np.array(at(1, 0.01)) == pytest.approx((parts[0] / 2 + parts[1] + parts[2]) / 2.5)


def test_drag_is_not_counted_twice(drone):
    with pytest.raises(ValueError, match=r"^effects.random_wind_force: includes drag.*allow_body_drag = true"):
        effects.from_scene({"random_wind_force": {}, "body_drag": {}}, drone)
    assert len(effects.from_scene({"random_wind_force": {"allow_body_drag": True}, "body_drag": {}}, drone)) == 2
