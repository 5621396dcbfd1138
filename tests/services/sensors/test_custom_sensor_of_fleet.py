"""Custom sensor that sees the other vehicles: the example of the guide, through the command."""

import re
from pathlib import Path

import numpy as np
import pytest

import lapwing
from tests.commands import run_command

GUIDE = Path("docs/guides/extensions.md").read_text().partition("## Sensors of fleets")[2]
PROXIMITY = re.search(r"```python\n(.*?)```", GUIDE, re.DOTALL)[1]
SHORT = ("--set", "run.duration=2", "--set", "success.require=[]", "--mode", "single-process")


def run(folder, scene, text=PROXIMITY):
    (folder / "proximity.py").write_text(text)
    settings = ("--set", "sensors.proximity.module=proximity", *SHORT)
    return run_command("run", scene, *settings, "--log", "flight.mcap", folder=folder)


@pytest.mark.nightly
@pytest.mark.long
def test_sensor_measures_distance_to_nearest_vehicle(tmp_path):
    done = run(tmp_path, "formation")
    assert done.returncode == 0, done.stderr
    log = tmp_path / "flight.mcap"
    flights = {name: lapwing.Flight.read(log, vehicle=name) for name in ("leader", "wing", "third")}
    for name, flight in flights.items():
        reading = flight.topic("custom_sensor/proximity")["values"]
        others = [other.truth.position for key, other in flights.items() if key != name]
        distance = np.min([np.linalg.norm(flight.truth.position - other, axis=1) for other in others], axis=0)
        assert reading[:, 0] == pytest.approx(distance[::25])
        assert (reading[:, 1] == 1.0).all()


@pytest.mark.long
def test_sensor_detects_no_vehicle_in_scene_of_one_vehicle(tmp_path):
    done = run(tmp_path, "hover")
    assert done.returncode == 0, done.stderr
    reading = lapwing.read_log(tmp_path / "flight.mcap").topic("custom_sensor/proximity")["values"]
    assert (reading == [100.0, 0.0]).all()


@pytest.mark.parametrize(
    ("mistake", "cause"),
    [("distance.wrong", "Unknown attribute 'wrong' of type float64"), ("sorted([distance], key=1)[0]", "Key must be")],
)
def test_code_that_does_not_compile_is_named_in_one_line(tmp_path, mistake, cause):
    done = run(tmp_path, "formation", PROXIMITY.replace("return min(distance, ", f"return min({mistake}, "))
    assert done.returncode == 2
    (line,) = done.stderr.strip().splitlines()[-1:]
    assert line.startswith("lapwing: ")
    assert "sensors.proximity.module: " in line
    assert cause in line
    assert "(proximity.py, line " in line
    assert "Traceback" not in done.stderr
