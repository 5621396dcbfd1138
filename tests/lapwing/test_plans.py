"""Plans of a fleet from the command line: assignment to vehicles, and flight."""

import json
import os
from pathlib import Path

import pytest

from lapwing.cli import run_options
from lapwing.dynamics.config_error import ConfigError
from lapwing.services.scene_resolver import load, resolve
from tests.commands import assert_rejected, run_command
from tests.cosim.memory_log import fly

PLAN = "lapwing/scenes/plans/delivery.plan"


def test_one_vehicle_needs_no_name():
    assert run_options.plan_overrides([PLAN], Path("hover"), []) == [
        "autopilot.accept_commands=true",
        "autopilot.follow_trajectory=false",
    ]
    assert list(run_options.plan_commands([PLAN], load("hover"))) == ["drone1"]
    assert run_options.plan_overrides([], Path("hover"), []) == []
    with pytest.raises(ValueError, match="expected one plan"):
        run_options.plan_files([PLAN, PLAN], load("hover"))


def test_named_vehicles_of_fleet_are_operated():
    values = [f"right={PLAN}"]
    assert run_options.plan_overrides(values, Path("fleet"), []) == [
        "vehicle.1.autopilot.accept_commands=true",
        "vehicle.1.autopilot.follow_trajectory=false",
    ]


@pytest.mark.parametrize(
    ("inputs", "message"),
    [
        ([PLAN], "the scene has several vehicles"),
        ([f"nobody={PLAN}"], "the scene has no vehicle nobody"),
        ([f"left={PLAN}", f"left={PLAN}"], "left has a plan already"),
    ],
)
def test_plan_of_unknown_vehicle_is_rejected(inputs, message):
    with pytest.raises(ValueError, match=rf"{message}; expected NAME=FILE, .*left, right, scout"):
        run_options.plan_files(inputs, load("fleet"))


@pytest.mark.long
def test_plan_of_one_vehicle_does_not_change_others():
    values, only = [f"right={PLAN}"], ["run.duration=8.0"]
    scene = load("fleet", [*only, *run_options.plan_overrides(values, Path("fleet"), only)])
    flight = fly(resolve(scene, run_options.plan_commands(values, scene)))
    assert flight.messages("right/status")[-1].mode == "mission"
    assert flight.view("right/ground_truth").position[-1, 2] > 1.0
    without = fly(resolve(load("fleet", only)))
    for name in ("left", "scout"):
        assert (flight.view(f"{name}/ground_truth").position == without.view(f"{name}/ground_truth").position).all()


REFUSED = {  # part of a plan, and the text of its refusal
    "fence": (
        {"geoFence": {"polygons": [{"inclusion": True, "polygon": [[40.0, 14.0], [41.0, 15.0]]}]}},
        "geoFence.polygons[0]: a polygon of 2 corners; expected 3 to 1000",
    ),
    "jump": ({"jump": 3}, "item 3, DO_JUMP: jumps in a circle without a waypoint; jump to a waypoint"),
    "distance": ({"latitude": 41.0}, "item 1, NAV_TAKEOFF: 25698 m from the start; expected at most 10000 m"),
}


@pytest.mark.long
@pytest.mark.parametrize("mode", ["single-process", "multi-process"])
@pytest.mark.parametrize(("part", "message"), REFUSED.values(), ids=REFUSED)
def test_refused_plan_ends_command_before_flight(tmp_path, mode, part, message):
    start = [part.get("latitude", 40.7686), 14.7907, 5.0]
    raws = [(22, [0, 0, 0, None, *start]), (21, [0, 0, 0, None, *start]), (177, [part.get("jump", 1), 1e9, *[0] * 5])]
    items = [{"type": "SimpleItem", "frame": 3, "command": command, "params": params} for command, params in raws]
    plan = tmp_path / "a.plan"
    plan.write_text(json.dumps({"fileType": "Plan", "mission": {"items": items}, **part}))
    words = ["run", "groundstation", "--plan", plan, "--mode", mode, "--speed", "max"]
    assert_rejected(run_command(*words, folder=tmp_path), f"lapwing: {plan}: {message}")
    assert os.listdir(tmp_path) == ["a.plan"]


@pytest.mark.parametrize("firmware", ["px4", "ardupilot"])
@pytest.mark.parametrize(
    ("number", "radius", "message"),
    [
        (84, 0.0, r".*a.plan: item 1, NAV_VTOL_TAKEOFF: not for multirotors"),
        (22, 9.0, r".*a.plan: geofence and rally points are not uploaded to a firmware"),
    ],
)
def test_plan_of_firmware_is_refused(tmp_path, firmware, number, radius, message):
    plan = tmp_path / "a.plan"
    items = [{"type": "SimpleItem", "frame": 3, "command": number, "params": [0, 0, 0, None, 40.7686, 14.7907, 5.0]}]
    circle = {"inclusion": True, "circle": {"center": [40.7686, 14.7907], "radius": radius}}
    fence = {"circles": [circle] if radius else []}
    plan.write_text(json.dumps({"fileType": "Plan", "mission": {"items": items}, "geoFence": fence}))
    scene = load(f"lapwing/scenes/{firmware}_quad.toml", [f'{firmware}.mission="{plan}"'])
    with pytest.raises(ConfigError, match=f"{firmware}.mission: {message}"):
        resolve(scene)


def test_skipped_items_are_reported(tmp_path):
    plan = tmp_path / "a.waypoints"
    plan.write_text("QGC WPL 110\n0 1 3 22 0 0 0 nan 40.7686 14.7907 5 1\n1 0 2 183 1 1500 0 0 0 0 0 1\n")
    lines = []
    run_options.plan_commands([str(plan)], load("hover"), lines.append)
    assert lines[:-1] == [f"{plan}: item 2, DO_SET_SERVO: skipped, the vehicle has no such output"]


@pytest.mark.long
def test_impact_on_slope_is_no_motor_failure(tmp_path):
    options = ["--mode", "single-process", "--speed", "max", "--set", "environment.terrain.slope=[0.0, 0.27]"]
    done = run_command("run", "groundstation", "--plan", PLAN, *options, "--log", tmp_path / "flown.mcap", code=0)
    assert "motor has failed" not in done.stdout
    assert "Landed at" in done.stdout
