"""Selected step in flights with motors that jump over their entire range, through the command."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.combinations import rest_nightly

SCENES = Path(__file__).parents[3] / "lapwing/scenes"


def check(scene, accuracy, folder, *more):
    """Check the accuracy of a scene with a selected step."""
    options = ["--set", f"solver.accuracy={accuracy}", "--set", "solver.integrator=rk4_renormalised", *more]
    result = folder / "accuracy.json"
    command = [sys.executable, "-m", "lapwing", "check", scene, "--accuracy", *options, "--json", str(result)]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    measured = json.loads(result.read_text())
    assert measured["step_selected"]
    assert measured["error"] <= accuracy


@pytest.mark.long
@pytest.mark.parametrize("scene", rest_nightly("excitation", "hexacopter"))
def test_selected_step_meets_accuracy_when_motors_saturate(scene, tmp_path):
    check(scene, 1e-4, tmp_path)


@pytest.mark.long
@pytest.mark.parametrize("accuracy", rest_nightly(1e-4, 1e-6))
def test_selected_step_meets_accuracy_between_limits_of_dc_motor(accuracy, tmp_path):
    """4 ms was selected for 1e-4, with an error of 1.0e-3 after 28 s, and no step for 1e-6."""
    text = (SCENES / "delivery_mission.toml").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if not line.startswith("step = 0.001")]
    at = lines.index("[effects.gravity]")
    (tmp_path / "mission.toml").write_text(
        "\n".join([*lines[:at], "[effects.dc_motor]", *lines[at:]]), encoding="utf-8"
    )
    check(str(tmp_path / "mission.toml"), accuracy, tmp_path, "--set", "run.duration=30")
