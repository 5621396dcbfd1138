"""Selected step in flights with motors that jump over their entire range, through the command."""

import json
import subprocess
import sys

import pytest


@pytest.mark.long
@pytest.mark.parametrize("scene", ["excitation", "hexacopter"])
def test_selected_step_meets_accuracy_when_motors_saturate(scene, tmp_path):
    options = ["--set", "solver.accuracy=1e-4", "--set", "solver.integrator=rk4_renormalised"]
    result = tmp_path / "accuracy.json"
    command = [sys.executable, "-m", "lapwing", "check", scene, "--accuracy", *options, "--json", str(result)]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    measured = json.loads(result.read_text())
    assert measured["step_selected"]
    assert measured["error"] <= 1e-4
