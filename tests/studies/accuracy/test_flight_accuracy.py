"""`lapwing check --accuracy`: error of a scene's flight against its accuracy."""

import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

from lapwing.studies.accuracy.flight_accuracy import FlightAccuracy
from lapwing.studies.accuracy.flight_accuracy_output import show
from lapwing.studies.accuracy.state_errors import Quantity, differences

ROOT = Path(__file__).parents[3]


def check(folder, *options, scene="hover"):
    command = [sys.executable, "-m", "lapwing", "check", scene, *options]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


SHORT = ("--set", "run.duration=1", "--set", "solver.step=0.004", "--set", "solver.integrator=rk4_renormalised")


@pytest.mark.long
@pytest.mark.parametrize(("accuracy", "code", "verdict"), [(1e-4, 0, "met"), (1e-9, 1, "missed")])
def test_command_compares_error_with_accuracy(tmp_path, accuracy, code, verdict):
    result = check(tmp_path, "--accuracy", "--json", "a.json", "--set", f"solver.accuracy={accuracy}", *SHORT)
    assert result.returncode == code, result.stderr
    assert f", required {accuracy:g}" in result.stdout
    assert [line.split(":")[0] for line in result.stdout.splitlines() if "rk4_renormalised, step" in line][:2] == [
        "flying up to 1 s",
        "flying up to 1 s",
    ]
    assert ("solver.step: set to 0.004 s, which does not depend on" in result.stdout) == (verdict == "missed")
    results = json.loads((tmp_path / "a.json").read_text())
    names = {quantity["name"] for quantity in results["quantities"]}
    assert {"position", "attitude", "velocity", "body rates", "rotor speed"} <= names
    assert results["error"] == max(quantity["error"] for quantity in results["quantities"])
    assert (results["error"] > accuracy) == (code == 1)


@pytest.mark.long
def test_unloading_crate_meets_accuracy(tmp_path):
    """The pack bounces on rollers, door and ground; a tenth of the accuracy per substep gave an error of 2.2e-3."""
    result = check(tmp_path, "--accuracy", "--set", "solver.accuracy=1e-4", scene="unload")
    assert result.returncode == 0, result.stdout + result.stderr


CLOSED_LOOP = ("--accuracy", "--set", "run.duration=8")
NO_RESOLUTION = tuple(
    word
    for key in ("imu.gyro.resolution_dps", "imu.accelerometer.resolution_mg", "magnetometer.resolution_nt")
    for word in ("--set", f"sensors.{key}=0")
)


@pytest.mark.long
@pytest.mark.parametrize(("accuracy", "code", "verdict"), [(1e-4, 0, "met"), (1e-9, 1, "missed")])
def test_solver_error_excludes_sensor_resolution(tmp_path, accuracy, code, verdict):
    """The resolution of the gyroscope is 2.7e-4 rad/s at any step; only the error of the solver decides."""
    options = (*CLOSED_LOOP, "--set", f"solver.accuracy={accuracy}", "--json", "a.json")
    result = check(tmp_path, *options, scene="delivery_mission")
    assert result.returncode == code, result.stdout + result.stderr
    assert f"accuracy of the solver {verdict}: " in result.stdout
    assert "closed loop" in result.stdout
    results = json.loads((tmp_path / "a.json").read_text())
    loop = results["closed_loop"]
    assert max(quantity["error"] for quantity in loop["quantities"]) > 1e-4 > 1e-6 > results["error"]
    assert loop["difference"]["error"] > 1e-7  # from 1e-12, by chance of values rounded differently
    if accuracy == 1e-4:
        assert loop["signal"]["name"].startswith("imu.")
        assert loop["true_difference"] < 0.1 * loop["signal"]["difference"]


@pytest.mark.long
def test_closed_loop_meets_accuracy_without_sensor_resolution(tmp_path):
    options = (*CLOSED_LOOP, *NO_RESOLUTION, "--set", "solver.accuracy=1e-6")
    result = check(tmp_path, *options, scene="delivery_mission")
    assert result.returncode == 0, result.stdout + result.stderr
    assert "accuracy met: " in result.stdout


@pytest.mark.parametrize(("error", "step"), [(4.1e-4, "0.002"), (1.5e-3, "0.002"), (1.7e-3, "0.00133333")])
def test_missed_selection_names_step_of_fourth_order(capsys, error, step):
    quantity = Quantity("a", "velocity", error, 1.0)
    show(Console(), FlightAccuracy(1e-4, "rk4_renormalised", 0.004, 0.0005, True, 2.0, [quantity]))
    assert f"--set solver.integrator=rk4_renormalised --set solver.step={step}\n" in capsys.readouterr().out


@pytest.mark.long
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--accuracy", *SHORT), "solver.accuracy: missing; set the error to compare with"),
        (("--json", "a.json"), "--json: holds the errors of a flight; give --accuracy, too"),
    ],
)
def test_command_rejects_incomplete_request(tmp_path, options, message):
    result = check(tmp_path, *options)
    assert result.returncode == 2
    assert message in result.stderr
    assert "Traceback" not in result.stderr
    assert not (tmp_path / "a.json").exists()


def test_error_is_relative_to_size_at_its_time():
    times = np.array([0.0, 0.1, 0.2])

    def flight(position, turned):
        half = 0.5 * np.array([0.0, turned, 0.0])
        truth = SimpleNamespace(
            times=times,
            position=np.array(position),
            velocity=np.zeros((3, 3)),
            angular_velocity=np.zeros((3, 3)),
            orientation=np.column_stack([np.cos(half), np.sin(half), 0.0 * half, 0.0 * half]),
            rotor_speed=np.zeros((3, 0)),
        )
        return SimpleNamespace(truth=truth, vehicle="a", has=lambda topic: False)

    exact = flight([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [9.0, 0.0, 0.0]], 0.0)
    other = flight([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [9.1, 0.0, 0.0]], 1e-3)
    result = {q.name: q for q in differences(other, exact)}
    assert (result["position"].error, result["position"].time) == (pytest.approx(0.01), 0.2)
    assert (result["attitude"].error, result["attitude"].time) == (pytest.approx(1e-3, rel=1e-3), 0.1)
    assert "rotor speed" not in result
