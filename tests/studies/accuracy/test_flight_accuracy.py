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

from lapwing.dynamics.integrators import LEAST_TOLERANCE
from lapwing.services.plant.schema import LEAST_ACCURACIES, Solver, contact_tolerance
from lapwing.services.scene_resolver import load
from lapwing.studies.accuracy.flight_accuracy import ClosedLoop, FlightAccuracy
from lapwing.studies.accuracy.state_errors import Quantity, differences
from lapwing.views.studies.flight_accuracy_console import show
from tests.combinations import rest_nightly

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
@pytest.mark.parametrize("accuracy", rest_nightly("1e-4", "1e-8"))
def test_unloading_crate_meets_accuracy(tmp_path, accuracy):
    """The pack bounces on rollers, door and ground; a tenth of the accuracy per substep gave an error of 2.2e-3."""
    result = check(tmp_path, "--accuracy", "--set", f"solver.accuracy={accuracy}", scene="unload")
    assert result.returncode == 0, result.stdout + result.stderr


CLOSED_LOOP = ("--accuracy", "--set", "run.duration=8")
NO_RESOLUTION = tuple(
    word
    for key in ("imu.gyro.resolution_dps", "imu.accelerometer.resolution_mg", "magnetometer.resolution_nt")
    for word in ("--set", f"sensors.{key}=0")
)


@pytest.mark.long
@pytest.mark.parametrize(("accuracy", "code", "verdict"), rest_nightly((1e-4, 0, "met"), (1e-9, 1, "missed")))
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


@pytest.mark.parametrize(("error", "step"), [(4.1e-4, "0.002"), (1.5e-3, "0.002"), (1.7e-3, "0.00133333333333")])
def test_missed_selection_names_step_of_fourth_order(capsys, error, step):
    """The scene accepts the step: it divides the communication step to 1e-9."""
    quantity = Quantity("a", "velocity", error, 1.0)
    show(Console(), FlightAccuracy(1e-4, "rk4_renormalised", 0.004, 0.0005, True, 2.0, [quantity]))
    assert f"--set solver.integrator=rk4_renormalised --set solver.step={step}\n" in capsys.readouterr().out
    load("hover", [f"solver.step={step}"])


def test_error_of_held_quantities_is_shown_apart_and_decides(capsys):
    quantities, held = [Quantity("a", "velocity", 1e-9, 1.0)], [Quantity("a", "position", 3e-5, 2.0)]
    result = FlightAccuracy(1e-6, "rk4_renormalised", 0.004, 0.0005, True, 2.0, quantities, 2.0, None, 250.0, held)
    assert not result.met
    show(Console(), result)
    lines = capsys.readouterr().out.splitlines()
    assert any(line.startswith("accuracy of the solver met: error 1.0e-09") for line in lines)
    assert "held quantities, updated at 250 Hz: missed, error 3.0e-05 (position, 2.000 s)" in lines
    assert lines[-1].startswith("communication.rate: 250 Hz holds quantities with an error of 3.0e-05")


@pytest.mark.parametrize("vehicles", [["a"], ["drone1", "drone2"]])
def test_table_of_closed_loop_has_all_digits_in_80_columns(capsys, vehicles):
    quantities = [
        Quantity(v, name, 6.3e-6, 128.996) for v in vehicles for name in ("battery voltage", "angular velocity of load")
    ]
    loop = ClosedLoop(quantities, 1e-8, quantities[0], None, 0.0)
    show(
        Console(width=80),
        FlightAccuracy(1e-4, "rk4_renormalised", 0.001, 1e-4, False, 2.0, quantities[: len(vehicles)], 2.0, loop),
    )
    lines = capsys.readouterr().out.splitlines()[1:9]
    assert sum(line.split()[-5:] == ["6.3e-06", "0.063", "128.996", "6.3e-06", "128.996"] for line in lines) >= 1
    assert all(word in " ".join(lines) for word in ("solver error", "/ accuracy", "at (s)", "closed loop"))


@pytest.mark.long
@pytest.mark.parametrize(
    ("scene", "accuracy", "limit"),
    [("hover", "1e-11", "ground_contact, 4e-10"), ("unload", "1e-09", "unloading, 6.7e-09"), ("hover", "1e-09", "")],
)
def test_accuracy_below_round_off_is_announced(tmp_path, scene, accuracy, limit):
    step = () if scene == "unload" else SHORT
    result = check(tmp_path, *step, "--set", f"solver.accuracy={accuracy}", scene=scene)
    assert result.returncode == 0, result.stderr
    name, _, least = limit.partition(", ")
    text = (
        f"substeps of {name} are limited by round-off, and {accuracy} may be missed in contact; use at least {least}\n"
    )
    assert result.stderr == (f"lapwing: warning: solver.accuracy: {text}" if limit else "")


@pytest.mark.parametrize("accuracy", LEAST_ACCURACIES.values())
def test_least_accuracy_has_least_tolerance(accuracy):
    """The tolerance of substeps is the same for stricter accuracies, and larger for coarser ones."""
    name = next(key for key, value in LEAST_ACCURACIES.items() if value == accuracy)
    tolerance = {
        "ground_contact": contact_tolerance,
        "shared_slung_load": lambda a: max(contact_tolerance(a), LEAST_TOLERANCE),
        "unloading": lambda a: Solver(accuracy=a).part_tolerance,
    }[name]
    assert tolerance(0.9 * accuracy) == tolerance(1e-12)
    assert tolerance(1.1 * accuracy) > tolerance(1e-12)


@pytest.mark.long
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--accuracy", *SHORT), "solver.accuracy: missing; set the error to compare with"),
        (("--json", "a.json"), "--json: needs the errors of a flight; use it with --accuracy"),
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
