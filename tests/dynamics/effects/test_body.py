"""Effects on the body: gravity, air density, drag, wrench, released payload."""

import numpy as np
import pytest
from effects_helpers import rotation_of

from lapwing.dynamics import effects
from lapwing.dynamics.atmosphere import Atmosphere, density
from lapwing.dynamics.effects.air_density import air_density, tangent
from lapwing.dynamics.effects.body_drag import body_drag
from lapwing.dynamics.effects.body_wrench import body_wrench
from lapwing.dynamics.effects.gravity_altitude import EARTH_RADIUS, GravityAltitude, gravity_altitude, weigh
from lapwing.dynamics.effects.payload_release import RELEASED, payload_release, release
from lapwing.dynamics.environment import STANDARD, Environment
from lapwing.dynamics.geodesy import Home


@pytest.mark.parametrize("height", [0.0, 1000.0, 10_000.0])
def test_weight_is_newtons_law(situation, rotors, height):
    e = GravityAltitude(9.80665, Home(height=500.0))
    s = situation(position=(0, 0, height))
    memory = weigh.py_func(e, e.initial_discrete_state(), s, rotors(), (0, 0), 0, 0.004)
    force, _ = gravity_altitude.py_func(e, memory, s, rotors())
    expected = 9.80665 * 10.0224 * (EARTH_RADIUS / (EARTH_RADIUS + 500.0 + height)) ** 2
    assert -force[2] == pytest.approx(expected, rel=1e-13)


def test_published_value_at_ten_kilometres():
    """U.S. Standard Atmosphere 1976, table I: 9.7759 m/s^2 at 10 km."""
    e = GravityAltitude(9.80665, Home(height=0.0))
    assert pytest.approx(9.7759, abs=1e-4) == 9.80665 * (EARTH_RADIUS / (EARTH_RADIUS + 10_000)) ** 2
    assert e.initial_discrete_state()[0] == 9.80665


HIGH = Environment(home=Home(46.0, 11.0, 800.0), atmosphere=Atmosphere(100_000.0, -10.0))


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("around", [STANDARD, HIGH])
@pytest.mark.parametrize("height", [0.0, 100.0, 3000.0, 12_000.0])
def test_density_equals_standard_atmosphere(drone, situation, rotors, around, height):
    (e,) = effects.from_scene({"air_density": {}}, drone, around)
    memory = tangent.py_func(
        e, e.initial_discrete_state(), situation(position=(0, 0, height)), rotors(), (0, 0), 0, 0.004
    )
    for above, bound in ((0.0, 1e-13), (0.08, 1e-10)):  # 20 m/s of climb for 4 ms
        s = situation(position=(0, 0, height + above))
        expected = density(around.atmosphere, around.home.height + height + above)
        assert air_density.py_func(e, memory, s, s.air).density == pytest.approx(expected, rel=bound)


@pytest.mark.usefixtures("uncompiled")
def test_density_starts_at_home_altitude(drone):
    (e,) = effects.from_scene({"air_density": {}}, drone, HIGH)
    assert e.initial_discrete_state()[0] == density(HIGH.atmosphere, 800.0)


def drag_world(drone, s, rotors, **table):
    (e,) = effects.from_scene({"body_drag": table}, drone)
    force, torque = body_drag.py_func(e, (), s, rotors())
    assert torque == (0.0, 0.0, 0.0)
    return rotation_of(s) @ force


@pytest.mark.usefixtures("uncompiled")
def test_against_formula_in_world_coordinates(drone, situation, rotors):
    s = situation(velocity=(8, -2, 1), wind=(3, 1, 0), turn=(0.2, -0.3, 0.5))
    v = np.array([5.0, -3.0, 1.0])
    R = rotation_of(s)
    area, linear = np.diag([0.06, 0.06, 0.16]), np.diag([0.1, 0.2, 0.3])
    expected = -R @ (0.5 * 1.2 * np.linalg.norm(v) * area + linear) @ R.T @ v
    assert drag_world(drone, s, rotors, linear=[0.1, 0.2, 0.3]) == pytest.approx(expected, rel=1e-12)


@pytest.mark.usefixtures("uncompiled")
def test_drag_dissipates_energy_and_vanishes_at_wind_speed(drone, situation, rotors):
    s = situation(velocity=(8, -2, 1), turn=(0.2, -0.3, 0.5))
    assert drag_world(drone, s, rotors) @ (8, -2, 1) < 0
    s = situation(velocity=(3, 1, 0), wind=(3, 1, 0))
    assert drag_world(drone, s, rotors) == pytest.approx((0, 0, 0))


@pytest.mark.usefixtures("uncompiled")
def test_airframe_without_areas_is_rejected(drone):
    with pytest.raises(ValueError, match=r"effects.body_drag: needs the key area"):
        effects.from_scene({"body_drag": {}}, drone.model_copy(update={"drag": None}))


def test_wrench_is_constant_in_body(drone, situation, rotors):
    (e,) = effects.from_scene({"body_wrench": {"force": [1.0, -2.0, 3.0], "torque": [0.1, 0.2, -0.3]}}, drone)
    for turn in ((0.0, 0.0, 0.0), (0.2, -0.3, 0.5)):
        force, torque = body_wrench.py_func(e, (), situation(turn=turn, velocity=(3, 0, 1)), rotors())
        assert force == (1.0, -2.0, 3.0)
        assert torque == (0.1, 0.2, -0.3)


def test_wrench_is_zero_by_default(drone, situation, rotors):
    (e,) = effects.from_scene({"body_wrench": {}}, drone)
    assert body_wrench.py_func(e, (), situation(), rotors()) == ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def test_non_finite_force_is_rejected(drone):
    with pytest.raises(ValueError, match=r"effects.body_wrench.force"):
        effects.from_scene({"body_wrench": {"force": [float("nan"), 0.0, 0.0]}}, drone)


def make(drone, **table):
    (e,) = effects.from_scene({"payload_release": table}, drone)
    return e


def test_mass_and_inertia_with_and_without(drone):
    e = make(drone)
    loaded, empty = payload_release.py_func(e, (0.0,), None), payload_release.py_func(e, RELEASED, None)
    assert loaded.mass == 10.0224
    assert empty.mass == pytest.approx(8.0224)
    box = 2.0 / 12 * np.array([0.13**2 + 0.23**2, 0.20**2 + 0.23**2, 0.20**2 + 0.13**2])
    assert np.subtract(loaded.inertia, empty.inertia) == pytest.approx(box)
    assert np.multiply(empty.inertia, empty.inverse_inertia) == pytest.approx(np.ones(3))


def test_payload_is_released_once_at_its_time(drone):
    e = make(drone, release_time=3.0)
    assert release.py_func(e, (0.0,), 2.999) == (0.0,)
    assert release.py_func(e, (0.0,), 3.0) == (1.0,)
    assert release.py_func(make(drone), RELEASED, 9.0) == (1.0,)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"mass": 11.0}, r"effects.payload_release.mass: expected less than the vehicle's 10.0224 kg, got 11.0"),
        ({"mass": -1.0}, r"effects.payload_release.mass: expected a number above 0 \[kg\], got -1.0"),
        ({"mass": 9.0, "size": [2.0, 2.0, 2.0]}, r"effects.payload_release: has more inertia"),
    ],
)
def test_invalid_payload_is_rejected(drone, table, message):
    with pytest.raises(ValueError, match=message):
        make(drone, **table)
