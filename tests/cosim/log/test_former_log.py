"""Log of version 0.1.0, recorded before modules, classes and scene keys were renamed (commit f1c8295)."""

import gzip
import json
import subprocess
import sys
from pathlib import Path

import pytest

from lapwing.cosim.config.former_names import DIRECTIONS, former_names, present_name, present_tables
from lapwing.cosim.config.serialise import _class_of, _fields, from_json, to_json
from lapwing.cosim.log import LogReader
from lapwing.runs.resimulate import recorded_setup
from lapwing.services.scene_resolver import from_resolved, load, vocabulary
from lapwing.services.sensors.barometer import Barometer, StaticPressureError
from lapwing.studies.flight_data import FlightData

RECORDED = Path(__file__).parent / "recorded" / "hover_0_1_0.mcap.gz"  # 0.3 s of hover
SCENES = (
    Path(__file__).parent / "recorded" / "scenes_0_1_0.json.gz"
)  # resolved tables by scene; no longer shipped: hover_many
MANY = {  # keys of "hover_many" under their present names
    "communication.coupling": "jacobi",
    "mavlink.system_id": 7,
    "mavlink.firmware": "ardupilot",
    "ros2.enabled": True,
    "ros2.domain_id": 3,
    "autopilot.estimator": "kalman",
    "vehicle.initial_position": [0.0, 1.0],
    "effects.battery.initial_charge": 0.9,
    "effects.random_wind_force.sigma": 0.1,
    "effects.ground_contact.friction": "regularised",
    "sensors.imu.preset": "mpu6000",
    "sensors.imu.delta_output": True,
    "sensors.imu.gyro.turn_on_bias_dps": 0.3,
    "sensors.gps.preset": "rtk",
    "sensors.gps.correlation_time": 10.0,
    "sensors.barometer": {},
    "sensors.magnetometer": {},
    "sensors.airspeed": {},
}


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "hover.mcap"
    path.write_bytes(gzip.decompress(RECORDED.read_bytes()))
    return path


def test_former_log_reads_and_verifies(log):
    with LogReader(log) as read:
        assert read.complete
        assert read.digest() == read.metadata["digest"]
        setup = recorded_setup(read)
    assert (setup.scene, setup.rate, set(setup.services)) == ("hover", 250, {"plant", "autopilot", "trajectory"})
    assert setup.coupling == read.metadata["coupling"] == "gauss_seidel"
    assert setup.resolved["communication"] == {"coupling": "gauss_seidel", "rate": 250}
    assert FlightData.read(log).origin.scene == setup.resolved
    assert b'"$":"cosim.setup:Setup"' in LogReader(log).attachments["setup.json"]


def run(log, tmp_path, *command):
    arguments = [sys.executable, "-m", "lapwing", command[0], str(log), *command[1:]]
    return subprocess.run(arguments, capture_output=True, text=True, timeout=300, check=False, cwd=tmp_path)


@pytest.mark.long
@pytest.mark.parametrize("command", [["verify"], ["report", "--out", "report.html"]])
def test_command_accepts_former_log(log, tmp_path, command):
    done = run(log, tmp_path, *command)
    assert done.returncode == 0, done.stderr


@pytest.mark.long
def test_resimulated_former_contact_has_another_digest(log, tmp_path):
    """The friction law was corrected since, so a vehicle on the ground does not move bit for bit as before."""
    done = run(log, tmp_path, "resimulate")
    assert done.returncode == 1
    assert "digests differ: recorded" in done.stderr
    assert "Traceback" not in done.stderr


def former_scenes():
    return json.loads(gzip.decompress(SCENES.read_bytes()))


@pytest.mark.parametrize("name", former_scenes())
def test_former_tables_resolve_to_present_scene(name):
    shipped = load("hover", MANY) if name == "hover_many" else load(name)
    former = from_resolved(former_scenes()[name], shipped.name)
    default = shipped.resolved["vehicle"] if shipped.vehicles else [shipped.resolved]
    tables = former.resolved["vehicle"] if former.vehicles else [former.resolved]
    for entry, other in zip(tables, default, strict=True):
        if entry["success"]["require"] == ["outcome != 'crashed'", "outcome != 'diverged'"]:  # default of 0.1.0
            entry["success"] = other["success"]
        if "run" in entry:
            entry["run"]["title"] = other["run"]["title"]  # rewritten since
        if "gains" in entry:
            description = entry["gains"]["description"]
            entry["gains"]["description"] = description.replace("theory.md", "theory")  # has several pages since
        motor = entry.get("airframe", {}).get("motor", {})
        if motor.get("peak_current") == 29.7:  # current at 24 V with power at 48 V, corrected since
            motor["peak_current"] = 26.5
    assert tables == default


def test_present_tables_keep_their_names():
    for scene in (load("hover", MANY), load("fleet")):
        assert present_tables(scene.resolved) == scene.resolved


def test_former_keys_map_to_present_tables_and_fields():
    assert set(former_names()["keys"]) <= set(vocabulary().sections)
    for name, renamed in former_names()["fields"].items():
        assert set(renamed.values()) - {"square_stiction_velocity"} <= set(_fields(_class_of(name, [])))
    for name, added in former_names()["added"].items():
        assert set(added) <= set(_fields(_class_of(name, [])))


@pytest.mark.parametrize("name", [*(f"{module}:x" for module in former_names()["modules"]), *former_names()["classes"]])
def test_alias_maps_to_present_module_and_class(name):
    module, _, path = present_name(name).partition(":")
    assert module.startswith("lapwing.")
    __import__(module)
    if name in former_names()["classes"]:
        assert hasattr(sys.modules[module], path)


def test_airspeed_error_in_former_log_becomes_static_pressure_error():
    """Former logs have one share of the dynamic pressure, in the parameters and in the scene."""
    table = {"sensors": {"barometer": {"airspeed_error": 0.2}}}
    assert present_tables(table)["sensors"]["barometer"] == {"static_pressure_error": dict.fromkeys(DIRECTIONS, 0.2)}
    assert StaticPressureError._fields == DIRECTIONS
    for share, error in ((0.2, StaticPressureError(*[0.2] * 5)), (0.0, None)):
        former = json.loads(to_json(Barometer()))
        del former["static_pressure_error"]
        assert from_json(json.dumps(former | {"airspeed_error": share})) == Barometer(static_pressure_error=error)


def test_user_module_may_have_name_of_former_package(tmp_path, monkeypatch):
    (tmp_path / "dynamics.py").write_text("from typing import NamedTuple\nclass Gains(NamedTuple):\n    p: float\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert _class_of("dynamics:Gains", ["dynamics"]).__module__ == "dynamics"
    monkeypatch.delitem(sys.modules, "dynamics")
