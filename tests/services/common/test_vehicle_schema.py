"""What services agree on: gravity at home, and how the vehicle stands there."""

import math
import re

import pytest

from lapwing.cosim.scene import SceneError
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.lie.quaternion import NO_ROTATION, rotation_matrix
from lapwing.messages.topics import IMU, TRUTH
from lapwing.services.common.communication_schema import ticks
from lapwing.services.common.vehicle_schema import active, airframe, gravity, start_height, start_pose
from lapwing.services.scene_resolver import load
from tests.cosim.service_harness import Alone


def without_gravity(*overrides):
    return load("hover", {"effects": {"rotor_thrust": {}, "ground_contact": {}}, **dict(overrides)})


def test_gravity_is_that_of_whichever_effect_gives_one():
    assert gravity(load("hover")) == 9.80665
    assert gravity(load("hover", ["environment.gravity=3.7"])) == 3.7
    assert gravity(without_gravity()) == 0.0
    altitude = without_gravity(("effects.gravity_altitude", {}), ("environment.home.height", 5000.0))
    assert gravity(altitude) == pytest.approx(9.80665 * (6_356_766.0 / 6_361_766.0) ** 2, rel=1e-12)
    assert gravity(altitude) == active(altitude)[0].initial_memory()[0]


def test_the_imu_reads_gravity_whichever_effect_gives_it():
    effects = {"gravity_altitude": {}, "rotor_thrust": {}, "ground_contact": {}}
    sea = {"effects": effects, "environment.home.height": 0.0}
    scene = load("delivery_mission", {**sea, "sensors.imu.preset": "ideal"})
    sensors = Alone(scene, "sensors")
    sensors.step(truth=sensors.setup.port("truth").like)
    assert sensors.message(IMU).linear_acceleration.z == pytest.approx(9.80665)


def test_on_level_ground_the_vehicle_starts_where_it_did():
    for overrides in ([], ["environment.terrain.slope=[0.0, 0.0]"]):
        assert start_pose(load("hover", overrides)) == ((0.0, 0.0, 0.35), NO_ROTATION)
    assert start_height(load("hover")) == 0.35


@pytest.mark.long
def test_on_a_slope_the_vehicle_starts_at_rest_and_stays():
    scene = load("hover", ["environment.terrain.slope=[0.1, 0.0]"])
    position, attitude = start_pose(scene)
    up = rotation_matrix(attitude)
    assert (up[2], up[5], up[8]) == pytest.approx(tuple(c / math.hypot(1.0, 0.1) for c in (-0.1, 0.0, 1.0)))
    plant = Alone(scene, "plant")
    for _ in range(251):
        plant.step()
        truth = plant.message(TRUTH)
        assert math.hypot(*truth.acceleration) < 1e-6
    moved = [a - b for a, b in zip(truth.pose.position, position, strict=True)]
    assert math.hypot(*moved) < 1e-3
    assert math.hypot(*truth.velocity) < 1e-3
    assert truth.pose.orientation.w > 0.99


def test_a_rate_that_does_not_divide_the_exchange_rate_is_refused():
    scene = load("hover")
    assert ticks(scene, 50, "rates.pose") == 5
    with pytest.raises(ConfigError, match=r"^rates.pose: expected a rate that divides exchange.rate = 250 Hz"):
        ticks(scene, 33, "rates.pose")


def test_a_scene_without_an_airframe_says_so():
    scene = load("os4_motors")
    assert not scene.has("airframe")
    with pytest.raises(ConfigError, match=r"^vehicle.airframe: missing; expected the name of an airframe"):
        airframe(scene)


@pytest.mark.parametrize("overrides", [["vehicle.mass=9.5"], {"vehicle.mass": 9.5}, ["airframe.mass.total=9.5"]])
def test_the_mass_of_the_vehicle_is_that_of_its_airframe(overrides):
    assert airframe(load("hover", overrides)).mass.total == 9.5


@pytest.mark.parametrize(
    ("scene", "overrides", "said"),
    [
        ("hover", ["vehicle.mas=9.5"], "--set vehicle.mas: unknown key 'mas'; did you mean mass?"),
        ("hover", ["vehicle.mass=0"], "--set vehicle.mass: expected a number above 0 [kg], got 0"),
        (
            "hover",
            ["vehicle.mass=9", "airframe.mass.total=8"],
            "--set vehicle.mass: 9 kg, and airframe.mass.total = 8 kg; expected one of them",
        ),
        ("gyrostat_chaotic", ["vehicle.mass=9"], "--set vehicle.mass: there is no airframe whose mass it could be"),
    ],
)
def test_a_mass_that_cannot_be_is_one_line(scene, overrides, said):
    with pytest.raises(SceneError, match=re.escape(said)):
        load(scene, overrides)
