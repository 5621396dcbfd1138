"""Complete runs with ArduPilot as the autopilot: a scripted program, or the real one (LAPWING_ARDUCOPTER)."""

import json
import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from lapwing.cosim.log import LogReader
from lapwing.dynamics.config_error import ConfigError
from lapwing.services.ardupilot.link import MAVLINK_PORT, PORT, STRIDE
from lapwing.services.scene_resolver import load, resolve
from tests.services.firmware_links import free_instance

PEER = Path(__file__).parent / "scripted_ardupilot.py"


def run(command, *options, timeout=900):
    """Run the scene with a program as ArduPilot."""
    instance = free_instance((socket.SOCK_DGRAM, PORT, STRIDE), (socket.SOCK_STREAM, MAVLINK_PORT, STRIDE))
    arguments = [sys.executable, "-m", "lapwing", "run", "ardupilot_quad", "--mode", "single-process"]
    arguments += ["--set", f"autopilot.command={json.dumps(command)}", "--set", f"autopilot.instance={instance}"]
    return subprocess.run([*arguments, *options], capture_output=True, text=True, timeout=timeout)


@pytest.mark.long
def test_scripted_firmware_flies_and_resimulates(tmp_path):
    log = tmp_path / "flight.mcap"
    result = run([sys.executable, str(PEER)], "--log", str(log), "--set", "run.duration=15.0")
    assert "leaves the ground" in result.stdout, result.stdout + result.stderr
    with LogReader(log) as reader:
        report = reader.metadata["firmware"]
    assert "skew 0 ms, resent 0, late 0, missed 0, rejected 0, reconnected 0" in report
    again = subprocess.run([sys.executable, "-m", "lapwing", "resimulate", str(log)], capture_output=True, text=True)
    assert again.returncode == 0, again.stdout + again.stderr


@pytest.mark.long
def test_program_end_in_flight_is_reported(tmp_path):
    result = run([sys.executable, str(PEER), "--die"], "--log", str(tmp_path / "flight.mcap"))
    assert result.returncode != 0
    assert "ardupilot: the program ended (exit code 1) at t = 4.00" in result.stderr
    assert "crashed on purpose" in result.stderr
    assert "Traceback" not in result.stderr


def test_slow_exchange_is_rejected():
    with pytest.raises(ConfigError, match="ArduPilot's loop runs at 400 Hz"):
        resolve(load("ardupilot_quad", ["communication.rate=250"]))


def test_missing_imu_is_rejected():
    with pytest.raises(ConfigError, match="needs an IMU"):
        resolve(load("ardupilot_quad", ["ardupilot.inertial=sensors"]))


def test_mission_is_part_of_configuration():
    plan = resolve(load("ardupilot_quad")).services["ardupilot"].parameters.plan
    actions = [item.action for command in plan for item in command.items]
    assert actions == ["takeoff", *["waypoint"] * 4, "yaw", "loiter_time", "land"]


@pytest.mark.long
@pytest.mark.skipif("LAPWING_ARDUCOPTER" not in os.environ, reason="LAPWING_ARDUCOPTER names no arducopter program")
def test_arducopter_flies_its_square(tmp_path):
    log, binary = tmp_path / "flight.mcap", Path(os.environ["LAPWING_ARDUCOPTER"]).resolve()
    result = run([str(binary)], "--log", str(log))
    assert result.returncode == 0, result.stdout + result.stderr
    assert "Landed" in result.stdout
    with LogReader(log) as reader:
        assert "skew 0 ms" in reader.metadata["firmware"]
