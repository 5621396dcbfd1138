"""Warnings of scenes that can be flown but hardly do what their author expects, wherever a scene is flown."""

import pytest

import lapwing
from tests.commands import run_command

SHORT = "run.duration: 5 s end the run before its trajectory; use at least 11 s"
HOVER = lapwing.load_scene("hover").path.read_text()
BUILDING = "environment.terrain.box=[{position = [3.0, 0.0], size = [1.0, 1.0], top = 9.0}]"


def test_run_shorter_than_its_trajectory_is_a_warning_of_all_commands(tmp_path):
    scene = tmp_path / "short.toml"
    scene.write_text(HOVER.replace("duration = 20.0", "duration = 5.0"))
    assert run_command("check", scene, code=0).stderr == f"lapwing: warning: {SHORT}\n"
    assert run_command("check", scene, "--set", "run.duration=4", code=0).stderr == ""  # on purpose
    words = ("campaign", scene, "--runs", "2", "--workers", "1", "--out", "short")
    assert run_command(*words, folder=tmp_path, code=0).stderr.count(SHORT) == 1
    assert run_command("test", scene, folder=tmp_path, code=0).stderr == f"lapwing: warning: short: {SHORT}\n"
    with pytest.warns(UserWarning, match=SHORT) as caught:
        lapwing.fly(scene)
    assert caught[0].filename == __file__


@pytest.mark.parametrize(("x", "z", "warns"), [(6.0, 4.0, True), (3.0, 12.0, False)])  # through it; onto its roof
def test_leg_through_a_building_is_a_warning(x, z, warns):
    route = f"trajectory={{waypoints = [[0.0, 0.0, {z}], [{x}, 0.0, {z}]]}}"
    done = run_command("check", "hover", "--set", route, "--set", BUILDING, "--set", "run.duration=60", code=0)
    place = "trajectory: x = 2.5 m, y = 0.0 m at t = 10.1 s in phase 'waypoint 2'"
    text = f"lapwing: warning: {place} is inside an obstacle 9.0 m high, at 4.0 m\n"
    assert done.stderr == (text if warns else "")
