"""Vehicle tables: gravity at home, start pose, mass."""

import math
import re

import pytest

from lapwing.cosim.scene import SceneError
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.lie.quaternion import NO_ROTATION, rotation_matrix
from lapwing.messages.topics import IMU, TRUTH
from lapwing.services.common.schemas.communication_schema import ticks
from lapwing.services.common.schemas.vehicle_schema import active, airframe, gravity, start_height, start_pose
from lapwing.services.scene_resolver import load
from tests.cosim.service_harness import Alone


def without_gravity(*overrides):
    return load("hover", {"effects": {"rotor_thrust": {}, "ground_contact": {}}, **dict(overrides)})


def test_gravity_comes_from_gravity_effect():
    assert gravity(load("hover")) == 9.80665
    assert gravity(load("hover", ["environment.gravity=3.7"])) == 3.7
    assert gravity(without_gravity()) == 0.0
    altitude = without_gravity(("effects.gravity_altitude", {}), ("environment.home.height", 5000.0))
    assert gravity(altitude) == pytest.approx(9.80665 * (6_356_766.0 / 6_361_766.0) ** 2, rel=1e-12)
    assert gravity(altitude) == active(altitude)[0].initial_discrete_state()[0]


def test_imu_reads_gravity_of_any_gravity_effect():
    effects = {"gravity_altitude": {}, "rotor_thrust": {}, "ground_contact": {}}
    sea = {"effects": effects, "environment.home.height": 0.0}
    scene = load("delivery_mission", {**sea, "sensors.imu.preset": "ideal"})
    sensors = Alone(scene, "sensors")
    sensors.step(truth=sensors.config.port("truth").example)
    assert sensors.message(IMU).linear_acceleration.z == pytest.approx(9.80665)


def test_start_pose_on_level_ground():
    for overrides in ([], ["environment.terrain.slope=[0.0, 0.0]"]):
        assert start_pose(load("hover", overrides)) == ((0.0, 0.0, 0.35), NO_ROTATION)
    assert start_height(load("hover")) == 0.35


@pytest.mark.long
def test_vehicle_rests_on_slope():
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


def test_rate_must_divide_communication_rate():
    scene = load("hover")
    assert ticks(scene, 50, "rates.pose") == 5
    with pytest.raises(ConfigError, match=r"^rates.pose: expected a rate that divides communication.rate = 250 Hz"):
        ticks(scene, 33, "rates.pose")


def test_missing_airframe_is_rejected():
    scene = load("os4_motors")
    assert not scene.has("airframe")
    with pytest.raises(ConfigError, match=r"^vehicle.airframe: missing; expected the name of an airframe"):
        airframe(scene)


@pytest.mark.parametrize("overrides", [["vehicle.mass=9.5"], {"vehicle.mass": 9.5}, ["airframe.mass.total=9.5"]])
def test_vehicle_mass_sets_airframe_mass(overrides):
    assert airframe(load("hover", overrides)).mass.total == 9.5


@pytest.mark.parametrize(
    ("scene", "overrides", "message"),
    [
        ("hover", ["vehicle.mas=9.5"], "override vehicle.mas: unknown key 'mas'; did you mean mass?"),
        ("hover", ["vehicle.mass=0"], "override vehicle.mass: expected a number above 0 [kg], got 0"),
        (
            "hover",
            ["vehicle.mass=9", "airframe.mass.total=8"],
            "override vehicle.mass: 9 kg, but airframe.mass.total = 8 kg; expected one of them",
        ),
        (
            "hover",
            ["vehicle.initial_position=[0, 0, 8]"],
            "override vehicle.initial_position: expected at most 2 of them, got [0, 0, 8]",
        ),
        ("gyrostat_chaotic", ["vehicle.mass=9"], "override vehicle.mass: the vehicle has no airframe"),
    ],
)
def test_invalid_value_of_vehicle_is_rejected(scene, overrides, message):
    with pytest.raises(SceneError, match=re.escape(message)):
        load(scene, overrides)
