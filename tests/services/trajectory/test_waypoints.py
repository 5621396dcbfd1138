"""Waypoints of a scene: legs through the points, no faster than asked, with turns of both kinds."""

import json
import tempfile
from pathlib import Path

import numpy as np
import pytest

from lapwing.cosim.scene import SceneError
from lapwing.dynamics.environment import STANDARD
from lapwing.dynamics.geodesy import enu_to_geodetic
from lapwing.kernels import python_function
from lapwing.services.common.schemas.run_schema import SHIPPED
from lapwing.services.scene_resolver import from_resolved, load
from lapwing.services.trajectory.polynomial_piece import channel_at
from lapwing.services.trajectory.schema import Trajectory, compile_trajectory

POINTS = [[0.0, 0.0, 5.0], [20.0, 0.0, 5.0], [20.0, 10.0, 8.0], [0.0, 10.0, 8.0]]


HEAD = (SHIPPED / "hover.toml").read_text().partition("[[trajectory.phase]]")[0]


def scene(more="", **keys):
    """Return the hover scene with these keys of [trajectory]; in a file, as users write it."""
    lines = [f"{key} = {json.dumps(value)}" for key, value in ({"waypoints": POINTS} | keys).items()]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.toml"
        path.write_text("\n".join([HEAD, "[trajectory]", *lines, more]))
        return load(path)


def flown(**keys):
    """Return times, positions (n, 3), velocities (n, 3) and names of the phases."""
    path = compile_trajectory(scene(**keys))
    at, p = python_function(channel_at), path.parameters
    times = np.linspace(0.0, path.duration, 4001)
    values = np.array([[at(channel, t)[:2] for channel in (p.x, p.y, p.z)] for t in times])
    return times, values[..., 0], values[..., 1], path.phases


@pytest.mark.parametrize("turn", ["stop", "round"])
def test_legs_pass_points_at_speed_and_land(turn):
    _, places, rates, names = flown(speed=3.0, turn=turn)
    assert names == ("take-off", "waypoint 2", "waypoint 3", "waypoint 4", "landing", "rest")
    for point in POINTS:
        assert np.linalg.norm(places - point, axis=1).min() < 0.02
    assert places[-1] == pytest.approx([0.0, 10.0, 0.0])
    speed = np.linalg.norm(rates, axis=1)
    assert 2.6 < speed.max() < 3.0 * 1.01
    steps = np.linalg.norm(np.diff(rates, axis=0), axis=1)
    assert steps.max() < 0.1  # the velocity is continuous


def test_vehicle_stops_at_points_or_passes_them():
    for turn, least in (("stop", 0.0), ("round", 2.0)):
        _, places, rates, _ = flown(speed=3.0, turn=turn)
        corner = np.linalg.norm(places - POINTS[1], axis=1).argmin()
        assert np.linalg.norm(rates[corner]) == pytest.approx(least, abs=0.2)


def test_route_on_one_line_keeps_its_speed_at_points():
    points = [[0.0, 0.0, 2.0], [10.0, 0.0, 2.0], [20.0, 0.0, 2.0], [30.0, 0.0, 2.0]]
    _, places, rates, _ = flown(waypoints=points, speed=4.0, turn="round", land=False)
    middle = (places[:, 0] > 10.1) & (places[:, 0] < 19.9)
    assert rates[middle, 0] == pytest.approx(4.0, abs=1e-6)
    assert places[-1] == pytest.approx(points[-1])


def test_round_turn_leaves_legs_near_points_only():
    """A leg to a sharp turn, once flown at a quarter of the speed and 6 m beside the line."""
    points = np.array([[0.0, 0.0, 3.0], [12.0, 18.0, 6.0], [12.0, 2.0, 6.0]])
    times, places, rates, _ = flown(waypoints=points.tolist(), speed=4.0, turn="round", land=False)
    assert np.linalg.norm(rates, axis=1).max() == pytest.approx(4.0, rel=0.01)
    legs = np.diff(points, axis=0)
    along = [np.clip((places - start) @ leg / (leg @ leg), 0.0, 1.0) for start, leg in zip(points, legs, strict=False)]
    beside = [np.linalg.norm(places - start - at[:, None] * leg, axis=1)
              for start, leg, at in zip(points, legs, along, strict=False)]  # fmt: skip
    assert 0.1 < np.min(beside, axis=0)[places[:, 2] >= 3.0].max() < 1.0
    assert times[-1] < 25.0


def test_resolved_table_has_waypoints_and_validates_again():
    first = scene(turn="round")
    assert "phase" not in first.resolved["trajectory"]
    assert from_resolved(first.resolved)[Trajectory] == first[Trajectory]
    assert "speed" not in load("hover").resolved["trajectory"]


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"waypoints": []}, "trajectory.waypoints: expected at least 1 of them"),
        ({"waypoints": [[0.0, 0.0]]}, "trajectory.waypoints.0: expected x, y, z [m], and"),
        ({"waypoints": [[0.0, 0.0, 5.0], [0.0, 0.0, 5.0]]}, "trajectory.waypoints.1: expected another point"),
        (
            {"waypoints": [[0.0, 0.0, 5.0], [6.0, 0.0, -3.0]]},
            "trajectory.waypoints.1: expected z of at least 0 m, the ground there, got -3 m",
        ),
        ({"speed": -1.0}, "trajectory.speed: expected a number above 0"),
        (
            {"speed": "15 kmh"},
            "expected a number above 0 [m/s], or a text with one of m/s, km/h, kn, mph, got '15 kmh'",
        ),
        ({"turn": "sharp"}, "trajectory.turn: expected 'stop' or 'round'"),
        (
            {"more": "[[trajectory.phase]]\nname = 'a'"},
            "trajectory.waypoints: expected one of the two, got waypoints and phases",
        ),
    ],
)
def test_invalid_route_is_rejected_with_its_key(keys, message):
    with pytest.raises(SceneError) as error:
        scene(**keys)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_phase_that_ends_below_the_ground_is_rejected():
    phase = [{"name": "down", "z": {"kind": "step", "to": -3.0}}]
    with pytest.raises(SceneError, match=r"phase\.0\.z: expected an end of at least 0 m, the ground there, got -3 m"):
        load("hover", {"trajectory.phase": phase})


def test_speed_without_waypoints_is_rejected():
    with pytest.raises(SceneError, match=r"trajectory\.speed: applies to waypoints only"):
        load("hover", {"trajectory.speed": 3.0})


def test_waypoint_may_be_place_on_earth_with_heading():
    home, start = STANDARD.home, (3.0, -2.0)
    latitude, longitude, _ = python_function(enu_to_geodetic)(home, (13.0, 18.0, 5.0))
    tables = [
        {"x": 0.0, "y": 0.0, "z": 5.0, "yaw_deg": 170.0},
        {"latitude_deg": latitude, "longitude_deg": longitude, "z": 5.0, "yaw_deg": "-170 deg"},
    ]
    result = load("hover", {"trajectory": {"waypoints": tables}, "vehicle.initial_position": start})
    (x, y, z, yaw), other = result[Trajectory].waypoints[::-1]
    assert (x, y, z) == pytest.approx((10.0, 20.0, 5.0), abs=1e-6)  # from the start
    assert np.degrees([other[3], yaw]) == pytest.approx([170.0, -170.0])
    path = compile_trajectory(result)
    at, p = python_function(channel_at), path.parameters
    assert np.degrees(at(p.yaw, path.duration)[0]) == pytest.approx(190.0)  # the shorter way
    rates = [abs(at(p.yaw, t)[1]) for t in np.linspace(0.0, path.duration, 2001)]
    assert 0.9 < max(rates) < 1.0 + 1e-9


@pytest.mark.parametrize(
    ("point", "message"),
    [
        ({"x": 1.0, "z": 5.0}, ": expected x and y, or latitude_deg and longitude_deg, got x, z"),
        ({"x": 1.0, "y": 1.0, "longitude_deg": 2.0, "z": 5.0}, ": expected x and y, or latitude_deg and longitude_deg"),
        ({"x": 1.0, "y": 1.0, "hight": 5.0}, ".hight: unknown key 'hight'"),
        ({"latitude_deg": 91.0, "longitude_deg": 2.0, "z": 5.0}, ".latitude_deg: expected a number at least -90"),
    ],
)
def test_invalid_waypoint_table_is_named(point, message):
    with pytest.raises(SceneError) as error:
        load("hover", {"trajectory": {"waypoints": [point]}})
    assert f"trajectory.waypoints.0{message}" in str(error.value)
