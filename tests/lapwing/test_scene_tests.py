"""`lapwing test` and the pytest plug-in: failed vehicles and failed simulations differ, failed flights are kept."""

import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import yaml

from tests.commands import run_command

SCENES = Path("lapwing/scenes").resolve()
HOVER = (SCENES / "hover.toml").read_text()
FAILS = HOVER + "\n[success]\nrequire = [\"outcome == 'landed'\", 'max_tilt > 1.0']\n"


def test_command_tells_failed_vehicle_from_failed_simulation(tmp_path):
    scenes = tmp_path / "scenes"
    scenes.mkdir()
    (scenes / "good.toml").write_text(HOVER)
    (scenes / "bad.toml").write_text(FAILS)
    result = run_command("test", "scenes", "--junit", "flights.xml", "--keep", "kept", folder=tmp_path)
    assert (result.returncode, result.stderr) == (4, "")
    assert result.stdout.endswith("1 passed, 1 failed, 0 errors\n")
    assert {path.name for path in (tmp_path / "kept").iterdir()} == {"bad.mcap", "bad.html"}
    (scenes / "invalid.toml").write_text(HOVER.replace("gravity", "gravty"))
    result = run_command("test", "scenes", "--junit", "flights.xml", "--keep", "kept", folder=tmp_path, code=1)
    suite = ElementTree.parse(tmp_path / "flights.xml").getroot()
    assert suite.attrib == {"name": "scenes", "tests": "3", "failures": "1", "errors": "1"}
    cases = {case.get("name"): [child.tag for child in case] for case in suite}
    assert cases == {"bad": ["failure"], "good": [], "invalid": ["error"]}
    assert "success.require: max_tilt > 1.0 (max_tilt is " in suite.find("testcase/failure").get("message")
    assert result.stdout.endswith("1 passed, 1 failed, 1 error\n")
    assert "did you mean gravity?" in suite.find("testcase/error").get("message")


TESTS = """
import pytest

def test_lands(fly_scene):
    flight = fly_scene("good.toml", {"run.seed": 3})
    assert flight.landed
    assert flight.rmse["z"] < 0.1

@pytest.mark.parametrize("criteria", [True, False])
def test_fails(fly_scene, criteria):
    flight = fly_scene("bad.toml", success=criteria)
    assert flight.rmse["z"] < 0.0
"""


def test_fixture_flies_and_keeps_flights_of_failed_tests_in_workers(tmp_path):
    (tmp_path / "good.toml").write_text(HOVER)
    (tmp_path / "bad.toml").write_text(FAILS)
    (tmp_path / "test_flights.py").write_text(TESTS)
    own = ["-p", "lapwing.pytest_plugin", "-p", "no:cacheprovider", "-n", "2", "--lapwing-keep", "kept"]
    tests = [sys.executable, "-m", "pytest", *own]
    result = subprocess.run(tests, cwd=tmp_path, capture_output=True, text=True)
    assert "1 passed" in result.stdout, result.stdout
    assert "2 failed" in result.stdout
    assert "success.require: max_tilt > 1.0" in result.stdout
    names = sorted(path.name for path in (tmp_path / "kept").glob("*.mcap"))
    assert names == [f"test_flights.py_test_fails_{criteria}__1.mcap" for criteria in ("False", "True")]
    assert f"log kept/{names[0]}" in result.stdout


def test_workflow_of_guide_runs_existing_command():
    text = Path("examples/ci/flights.yml").read_text()
    assert f"```yaml\n{text}```" in Path("docs/guides/continuous_integration.md").read_text()
    workflow = yaml.safe_load(text)
    commands = [step["run"] for step in workflow["jobs"]["fly"]["steps"] if "run" in step]
    assert any("lapwing test scenes --junit flights.xml --keep failed" in command for command in commands)
