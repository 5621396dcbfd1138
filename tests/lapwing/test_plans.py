"""Plans of a fleet from the command line: assignment to vehicles, and flight."""

import subprocess
import sys
from pathlib import Path

import pytest

from lapwing.cli import plan_options
from lapwing.services.scene_resolver import load, resolve
from tests.cosim.memory_log import fly

PLAN = "lapwing/scenes/plans/delivery.plan"


def test_one_vehicle_needs_no_name():
    assert plan_options.overrides([PLAN], Path("hover"), []) == [
        "autopilot.accept_commands=true",
        "autopilot.follow_trajectory=false",
    ]
    assert list(plan_options.commands([PLAN], load("hover"))) == ["drone1"]
    assert plan_options.overrides([], Path("hover"), []) == []
    with pytest.raises(ValueError, match="expected one plan"):
        plan_options.files([PLAN, PLAN], load("hover"))


def test_named_vehicles_of_fleet_are_operated():
    values = [f"right={PLAN}"]
    assert plan_options.overrides(values, Path("fleet"), []) == [
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
        plan_options.files(inputs, load("fleet"))


@pytest.mark.long
def test_plan_of_one_vehicle_does_not_change_others():
    values, only = [f"right={PLAN}"], ["run.duration=8.0"]
    scene = load("fleet", [*only, *plan_options.overrides(values, Path("fleet"), only)])
    flight = fly(resolve(scene, plan_options.commands(values, scene)))
    assert flight.messages("right/status")[-1].mode == "mission"
    assert flight.view("right/ground_truth").position[-1, 2] > 1.0
    without = fly(resolve(load("fleet", only)))
    for name in ("left", "scout"):
        assert (flight.view(f"{name}/ground_truth").position == without.view(f"{name}/ground_truth").position).all()


@pytest.mark.long
def test_impact_on_slope_is_no_motor_failure(tmp_path):
    command = [sys.executable, "-m", "lapwing", "run", "groundstation", "--plan", PLAN, "--speed", "max"]
    command += ["--mode", "single-process", "--log", str(tmp_path / "flown.mcap")]
    command += ["--set", "environment.terrain.slope=[0.0, 0.27]"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "motor has failed" not in done.stdout
    assert "Landed at" in done.stdout
