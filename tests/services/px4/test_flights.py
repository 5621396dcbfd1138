"""Complete runs with PX4 as the autopilot: a scripted program, and the real one if LAPWING_PX4 is set."""

import json
import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from lapwing.cosim.log import LogReader
from lapwing.cosim.scene.scene_error import SceneError
from lapwing.dynamics.config_error import ConfigError
from lapwing.services.px4.connection import MAVLINK_PORT, PORT
from lapwing.services.scene_resolver import load, resolve
from tests.services.firmware_links import free_instance

PEER = Path(__file__).parent / "scripted_px4.py"
SCENE = Path(__file__).parents[3] / "lapwing/scenes/px4_quad.toml"


def run(command, *options, timeout=600):
    """Run the scene with a program as PX4."""
    instance = free_instance((socket.SOCK_STREAM, PORT, 1), (socket.SOCK_DGRAM, MAVLINK_PORT, 1))
    arguments = [sys.executable, "-m", "lapwing", "run", "px4_quad", "--mode", "single-process"]
    arguments += ["--set", f"autopilot.command={json.dumps(command)}", "--set", f"autopilot.instance={instance}"]
    return subprocess.run([*arguments, *options], capture_output=True, text=True, timeout=timeout)


@pytest.mark.long
def test_scripted_firmware_flies_and_resimulates(tmp_path):
    log = tmp_path / "flight.mcap"
    result = run([sys.executable, str(PEER)], "--log", str(log))
    assert result.returncode == 0, result.stdout + result.stderr
    with LogReader(log) as reader:
        report = reader.metadata["firmware"]
    assert report.startswith("px4: ")
    assert "skew 0 ms, resent 0, late 0, missed 0, rejected 0" in report
    again = subprocess.run([sys.executable, "-m", "lapwing", "resimulate", str(log)], capture_output=True, text=True)
    assert again.returncode == 0, again.stdout + again.stderr


@pytest.mark.long
def test_stalled_firmware_is_reported_and_log_readable(tmp_path):
    log = tmp_path / "flight.mcap"
    result = run([sys.executable, str(PEER), "--stall"], "--log", str(log), "--set", "autopilot.step_timeout=2.0")
    assert result.returncode != 0
    assert "px4: no HIL_ACTUATOR_CONTROLS for 2 s at t = " in result.stderr
    assert "Traceback" not in result.stderr
    with LogReader(log) as reader:
        times, _ = reader.history("/drone1/ground_truth")
    assert times[-1] > 2_000_000_000


@pytest.mark.long
def test_missing_program_is_reported(tmp_path):
    log = tmp_path / "flight.mcap"
    result = run(["/nowhere/px4"], "--log", str(log))
    assert result.returncode == 2
    assert "autopilot.command: cannot start /nowhere/px4; expected path of a program" in result.stderr
    assert "Traceback" not in result.stderr
    assert not log.exists()


@pytest.mark.long
def test_missing_working_directory_is_reported(tmp_path):
    result = run(
        [sys.executable], "--set", f"autopilot.directory={tmp_path}/nowhere", "--log", str(tmp_path / "a.mcap")
    )
    assert result.returncode == 2
    assert "autopilot.directory: no folder" in result.stderr


def test_missing_sensor_is_rejected(tmp_path):
    scene = SCENE.read_text().replace("[sensors.barometer]\n", "").replace("plans/", f"{SCENE.parent}/plans/")
    (tmp_path / "scene.toml").write_text(scene)
    with pytest.raises((ConfigError, SceneError), match=r"needs \[sensors.barometer\]"):
        resolve(load(tmp_path / "scene.toml"))


def test_invalid_mission_is_rejected(tmp_path):
    (tmp_path / "bad.plan").write_text("{}")
    (tmp_path / "scene.toml").write_text(SCENE.read_text().replace("plans/square_px4.plan", "bad.plan"))
    checked = subprocess.run(
        [sys.executable, "-m", "lapwing", "check", str(tmp_path / "scene.toml")], capture_output=True, text=True
    )
    assert checked.returncode == 2
    assert "px4.mission" in checked.stderr
    assert "Traceback" not in checked.stderr


@pytest.mark.long
@pytest.mark.skipif("LAPWING_PX4" not in os.environ, reason="LAPWING_PX4 names no px4 program")
def test_px4_flies_its_square(tmp_path):
    log, binary = tmp_path / "flight.mcap", Path(os.environ["LAPWING_PX4"]).resolve()
    command = [str(binary), "-d", str(binary.parents[1] / "etc")]
    environment = 'autopilot.environment={PX4_SIM_MODEL = "none_iris"}'
    links = "autopilot.instance=8"  # missions go to instances 0 to 9 only
    result = run(command, "--log", str(log), "--set", environment, "--set", links)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "Landed" in result.stdout
    with LogReader(log) as reader:
        assert "skew 0 ms" in reader.metadata["firmware"]
