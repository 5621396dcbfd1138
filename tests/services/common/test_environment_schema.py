"""Environment table: one value for all services, rejection of invalid values."""

import re

import numpy as np
import pytest

from lapwing.cosim.scene import SceneError
from lapwing.dynamics.atmosphere import density, pressure
from lapwing.dynamics.environment import STANDARD
from lapwing.dynamics.geodesy import normal_gravity
from lapwing.dynamics.terrain import Level, surface
from lapwing.messages import NavSatStatus
from lapwing.messages.topics import BARO, GPS
from lapwing.services.common.schemas.environment_schema import environment
from lapwing.services.common.schemas.vehicle_schema import active, gravity, start_pose
from lapwing.services.scene_resolver import from_resolved, load, resolve
from tests.cosim.service_harness import Alone

PLACE = {
    "environment.home": {"latitude_deg": 47.3, "longitude_deg": 8.5, "height": 1600.0},
    "environment.date": "2027-03-01",
    "environment.atmosphere": {"sea_level_pressure": 100_500.0, "temperature_offset": 12.0},
    "environment.gravity_model": "wgs84",
    "environment.terrain.slope": [0.05, 0.0],
}


def test_environment_has_standard_defaults():
    assert environment(load("hover")) == STANDARD


def test_all_services_share_environment():
    config = resolve(scene := load("delivery_mission", PLACE))
    around = environment(scene)
    assert gravity(scene) == around.gravity == normal_gravity(47.3)
    air = next(effect for effect in active(scene) if hasattr(effect, "atmosphere"))
    assert air.initial_discrete_state()[0] == density(around.atmosphere, 1600.0)
    instruments = config.services["sensors"].parameters
    assert {instrument.environment.home for instrument in instruments} == {around.home}
    filter_ = config.services["autopilot"].parameters.estimator
    assert (filter_.home, filter_.atmosphere, filter_.gravity) == (around.home, around.atmosphere, around.gravity)
    assert filter_.magnetic_field_world == around.magnetic_field_world != STANDARD.magnetic_field_world
    assert filter_.sonar_height_max == 0.0  # the filter assumes level ground
    assert config.auxiliary["mavlink"].home == around.home
    assert config.auxiliary["mavlink"].air_temperature == pytest.approx(15.0 + 12.0 - 0.0065 * 1600.0, abs=0.01)


@pytest.mark.long
def test_barometer_and_rotors_share_atmosphere():
    scene = load("delivery_mission", {**PLACE, "sensors.barometer.preset": "ideal", "sensors.gps.preset": "standard"})
    sensors, plant = Alone(scene, "sensors"), resolve(scene).services["plant"].parameters
    sensors.step(truth=sensors.config.port("truth").example)
    around = environment(scene)
    assert sensors.message(BARO).fluid_pressure == pressure(around.atmosphere, 1600.0)
    assert sensors.message(GPS).status.status == NavSatStatus.STATUS_FIX  # not RTK
    assert plant.start.vehicle.motion.position_world[2] == pytest.approx(start_pose(scene)[0][2], abs=1e-4)


def test_recorded_scene_needs_no_terrain_file(tmp_path):
    heights = np.add.outer(0.1 * np.arange(5.0), 0.05 * np.arange(7.0) ** 2)
    np.save(tmp_path / "hill.npy", heights)
    grid = {"file": str(tmp_path / "hill.npy"), "corner": [-3.0, -2.0], "spacing": 1.5}
    scene = load("hover", {"environment.terrain.grid": grid, "environment.home.height": 30.0})
    again = from_resolved(scene.resolved, "hover")
    (tmp_path / "hill.npy").unlink()
    assert again == scene
    result, ground = environment(again), environment(scene).terrain
    assert result.home == environment(scene).home
    assert surface(result.terrain, 1.0, 2.0) == surface(ground, 1.0, 2.0)
    at_home = heights[0, 2] + 0.1 * 4.0 / 3.0  # column 2, a third between rows 1 and 2
    assert surface(ground, 4.5, 2.5)[0] == pytest.approx(heights[3, 5] - at_home)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (
            {"home": {"latitude_deg": 95.0}},
            "home.latitude_deg: expected a number at least -90 and at most 90 [deg], got 95",
        ),
        ({"date": "2040-01-01"}, "date: expected a date from 2010 to 2029, or magnetic_field, got 2040-01-01"),
        ({"date": "2025-02-30"}, "date: expected a date such as 2025-07-01, got 2025-02-30"),
        ({"gravity": -1.0}, "gravity: expected a number at least 0 and at most 30"),
        (
            {"magnetic_field": [1.0, 0.0, 0.0]},
            "magnetic_field.0: expected a number at least -0.0001 and at most 0.0001",
        ),
        ({"atmosphere": {"sea_level_pressure": 1013.0}}, "sea_level_pressure: expected a number at least 85000"),
        ({"terrain": {"box": {"size": [1.0, 1.0, 1.0]}}}, "terrain.box: expected a list of tables, with [[ ]]"),
        ({"terrain": {"slop": [0.0, 0.0]}}, "terrain.slop: unknown key 'slop'; did you mean slope?"),
        ({"terrain": {"slope": [0.9, 0.9]}}, "terrain.slope: ground steeper than 45 degrees"),
        (
            {"terrain": {"grid": {"heights": [[0.0, 1.0], [0.0]]}}},
            "heights: expected rows of equal length, got rows of 1",
        ),
        ({"terrain": {"grid": {"heights": [[0.0, float("nan")]]}}}, "heights.0.1: expected a finite number, got nan"),
        ({"terrain": {"grid": {"spacing": 1.0}}}, "terrain.grid: has neither file nor heights"),
        ({"terrain": {"grid": {"file": "no.npy"}}}, "no.npy: no such file or directory"),
        ({"terrain": {"grid": {"heights": [[0.0, 1.0], [0.0, 1.0]], "reach": 5.0}}}, "grid.reach: needs a GeoTIFF"),
        (
            {"terrain": {"steps": {"distance": [1.0], "rise": []}}},
            "steps.rise: expected one for each distance (1), got 0",
        ),
    ],
)
def test_invalid_environment_is_rejected(table, message):
    with pytest.raises(SceneError, match=re.escape(message)) as error:
        load("hover", {"environment": table})
    assert "environment." in str(error.value)
    assert "\n" not in str(error.value)


def test_start_inside_obstacle_is_rejected():
    pillar = {"environment.terrain.cylinder": [{"position": [0.0, 0.0], "radius": 0.1, "top": 0.6}]}
    with pytest.raises(
        SceneError, match=r"environment.terrain: intersects the vehicle at the start: point \(0, 0, 0\) m would be"
    ):
        resolve(load("hover", pillar))


@pytest.mark.parametrize(
    "terrain",
    [
        {"steps": {"distance": [0.1], "rise": [3.0]}},
        {"box": [{"position": [0.3, 0.0], "size": [0.2, 4.0], "top": 5.0}]},
    ],
)
def test_start_on_wall_is_rejected(terrain):
    with pytest.raises(SceneError, match=r"environment.terrain: the ground at the start .* would tilt by 8\d degrees"):
        resolve(load("hover", {"environment.terrain": terrain}))


def test_start_pose_is_on_top_of_box():
    roof = {"environment.terrain.box": [{"position": [0.0, 0.0], "size": [3.0, 3.0], "top": 2.0}]}
    assert start_pose(load("hover", roof))[0] == pytest.approx((0.0, 0.0, 2.35))
    assert isinstance(environment(load("hover", {"environment.terrain.slope": [0.0, 0.0]})).terrain, Level)
