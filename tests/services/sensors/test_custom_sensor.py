"""Sensors of user modules, alone and in a fleet."""

import re
from pathlib import Path

import numpy as np
import pytest

import lapwing
from lapwing.dynamics.config_error import ConfigError
from lapwing.runs.multi_process_run import fly_processes
from lapwing.runs.observer import Silent
from lapwing.runs.single_process_run import fly_single
from lapwing.services.process_main import ProcessSpec
from lapwing.services.scene_resolver import load, resolve
from lapwing.services.sensors.schema import module_of
from lapwing.studies.simulate import fly
from tests.commands import run_command

ANEMOMETER = """
from typing import NamedTuple
from lapwing.kernels import kernel
from lapwing.dynamics.noise import normal
from lapwing.dynamics.vector import norm

class Anemometer(NamedTuple):
    deviation: float = 0.0  # [m/s]
    rate: float = 50.0  # [Hz]

class AnemometerReading(NamedTuple):
    speed: float = 0.0  # [m/s]
    valid: bool = False

class State(NamedTuple):
    samples: float = 0.0

PRESETS = {"ideal": Anemometer(), "noisy": Anemometer(0.1)}
READING = AnemometerReading()

def blank():
    return State()

@kernel
def initial(p, key, truth):
    return State(0.0)

@kernel
def sample(p, s, key, tick, truth):
    speed = norm(truth.velocity_world) + p.deviation * normal(key, tick, 0)
    return State(s.samples + 1.0), AnemometerReading(speed, True)
"""
ESTIMATOR = """
from lapwing.services.autopilot.custom.estimator_api import StateEstimate

class Echo:
    rate = 50.0
    def __init__(self, vehicle):
        pass
    def step(self, time, readings):
        return StateEstimate(velocity_world=(readings["anemometer"].speed if readings else 0.0, 0.0, 0.0))
"""


@pytest.fixture
def scene(tmp_path):
    def make(*overrides, text=ANEMOMETER):
        (tmp_path / "own_anemometer.py").write_text(text)
        (tmp_path / "own_echo.py").write_text(ESTIMATOR)
        path = tmp_path / "hover.toml"
        path.write_text(
            Path("lapwing/scenes/hover.toml").read_text() + '[sensors.anemometer]\nmodule = "own_anemometer"\n'
        )
        return load(path, ["run.duration=3.0", *overrides])

    return make


def test_custom_sensor_is_logged_and_reaches_estimator(scene):
    flight = fly(scene())
    readings = flight.topic("custom_sensor/anemometer")["values"]
    true = np.linalg.norm(flight.truth["velocity"][::5], axis=1)
    assert readings[:, 0] == pytest.approx(true)
    assert (readings[:, 1] == 1.0).all()
    reported = fly(scene("autopilot.estimator=own_echo:Echo")).topic("estimate")["velocity"][:, 0]
    assert reported.max() > 0.0


@pytest.mark.long
def test_custom_sensors_have_separate_topics(scene, tmp_path):
    (tmp_path / "own_height.py").write_text(
        ANEMOMETER.replace("AnemometerReading", "HeightReading").replace(
            "norm(truth.velocity_world)", "truth.position_world[2]"
        )
    )
    values = scene(
        "sensors.height.module=own_height", "sensors.height.rate=25.0", "sensors.second.module=own_anemometer"
    )
    config, flight = resolve(values), lapwing.fly(values)
    speed, second, height = (flight.topic(f"custom_sensor/{name}") for name in ("anemometer", "second", "height"))
    assert (speed["values"] == second["values"]).all()
    assert height["values"][:, 0] == pytest.approx(flight.truth.position[::10, 2])
    assert set(height["sensor"]) == {"height"}
    fly_single(config, tmp_path / "single.mcap")
    fly_processes(ProcessSpec("mission", config, {}, "test-own-sensors", log=str(tmp_path / "own.mcap")), Silent())
    logs = [lapwing.read_log(tmp_path / f"{name}.mcap") for name in ("single", "own")]
    logs.append(lapwing.read_log(flight.save(tmp_path / "saved.mcap")))
    assert {log.digest for log in logs} == {flight.digest}
    assert (logs[1].topic("custom_sensor/height")["values"] == height["values"]).all()


def test_preset_of_custom_sensor_sets_its_noise(scene):
    noisy = fly(scene("sensors.anemometer.preset=noisy")).topic("custom_sensor/anemometer")["values"][:, 0]
    ideal = fly(scene()).topic("custom_sensor/anemometer")["values"][:, 0]
    assert np.std(noisy - ideal) == pytest.approx(0.1, rel=0.3)


@pytest.mark.parametrize(
    ("overrides", "text", "message"),
    [
        (("sensors.anemometer.deviatoin=1.0",), ANEMOMETER, "sensors.anemometer.deviatoin: unknown key"),
        (("sensors.anemometer.rate=60.0",), ANEMOMETER, "sensors.anemometer.rate: expected a rate that divides"),
        (
            ("sensors.anemometer.faults=[{kind='bias'}]",),
            ANEMOMETER,
            "sensors.anemometer.faults: anemometer has no fault model",
        ),
        ((), ANEMOMETER.replace("READING =", "READ ="), "sensors.anemometer.module: own_anemometer has no READING"),
        ((), ANEMOMETER.replace("(speed, True)", "(speed, 1.0)"), "sample's reading is of another type"),
        (('sensors.a-b.module="own_anemometer"',), ANEMOMETER, "sensors.a-b: expected a valid topic name"),
    ],
)
def test_custom_sensor_errors_are_one_line(scene, overrides, text, message):
    with pytest.raises(ConfigError) as caught:
        resolve(scene(*overrides, text=text))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_name_of_built_in_sensor_is_reserved():
    with pytest.raises(ConfigError, match=r"gps.module: gps is the name of a built-in sensor; expected another name"):
        module_of("gps", {"module": "own_anemometer"})


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
