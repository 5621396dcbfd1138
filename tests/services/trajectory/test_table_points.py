"""Points of tables, and release of a payload."""

from pathlib import Path

import numpy as np
import pytest

from lapwing.cosim.scene import SceneError
from lapwing.services.scene_resolver import load
from lapwing.services.trajectory.schema import parse_table
from lapwing.studies.simulate import fly

FILE = Path("points.csv")


def test_csv_points_are_read():
    assert parse_table("time , value\n0,1\n2,5e-1\n", FILE) == [[0.0, 1.0], [2.0, 0.5]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("t,v\n0,1\n", "points.csv:1: expected the header time,value, got 't,v'"),
        ("", "points.csv:1: expected the header time,value, got ''"),
        ("time,value\n0,1\n", "points.csv:2: expected at least two points"),
        ("time,value\n0,1\n1,x\n", "points.csv:3: expected two numbers, got '1,x'"),
        ("time,value\n0,1\n1,2,3\n", "points.csv:3: expected two numbers"),
        ("time,value\n0,1\n1,nan\n", "points.csv:3: expected finite numbers"),
        ("time,value\n1,1\n2,2\n", "points.csv:2: expected times that start at 0 and ascend"),
        ("time,value\n0,1\n0,2\n", "points.csv:3: expected times that start at 0 and ascend"),
    ],
)
def test_invalid_csv_is_rejected_with_its_line(text, message):
    with pytest.raises(SceneError) as error:
        parse_table(text, FILE)
    assert str(error.value).startswith(message)


def height(to):
    return {"kind": "minimum_jerk", "to": to, "duration": 3.0}


@pytest.mark.long
def test_payload_is_released_only_on_ground():
    phases = [
        {"name": "climb", "z": height(1.0)},
        {"name": "hover", "duration": 3.0, "release": True},
        {"name": "descend", "z": height(0.0), "release": True},
        {"name": "stand", "duration": 2.0, "release": True},
        {"name": "climb again", "z": height(1.0)},
        {"name": "hover again", "duration": 3.0},
        {"name": "descend again", "z": height(0.0)},
    ]
    flight = fly(load("hover", {"effects.payload_release": {}, "trajectory.phase": phases, "run.duration": 18.0}))
    t, thrust = flight.config.interval * np.arange(len(flight.truth)), flight.truth.rotor_thrust.sum(axis=1)
    first, second = ((t > begin) & (t < begin + 1.0) for begin in (4.5, 15.5))
    weight = [mass * 9.80665 for mass in (10.0224, 8.0224)]
    assert [thrust[first].mean(), thrust[second].mean()] == pytest.approx(weight, rel=0.01)
