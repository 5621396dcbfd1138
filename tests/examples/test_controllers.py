"""The controllers in examples/ fly a shortened delivery mission, with sensors and wind."""

import pytest

from lapwing.services.scene_resolver import load
from lapwing.studies.simulate import fly

pytestmark = pytest.mark.long

SHORT = {
    "trajectory.phase.1.z.to": 2.0,
    "trajectory.phase.2.duration": 1.0,
    "trajectory.phase.3.x.to": 2.0,
    "trajectory.phase.4.duration": 1.0,
    "trajectory.phase.5.y.to": 2.0,
    "trajectory.phase.6.duration": 1.0,
    "trajectory.phase.8.duration": 1.0,
}


@pytest.mark.parametrize("name", ["lqr", "geometric"])
def test_mission_ends_on_ground(name):
    flight = fly(load(f"examples/{name}_mission.toml", SHORT))
    assert flight.failure == ""
    assert flight.landed
    published = load("delivery_mission").lookup("published.rmse")
    for axis in ("x", "y", "z", "yaw"):
        assert flight.rmse[axis] < published[axis]
