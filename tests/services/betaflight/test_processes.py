"""Betaflight's adapter as a process of a run, with a scripted firmware."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from betaflight_peer import Peer, free_ports

from lapwing import Simulator
from lapwing.api.flight import Flight
from lapwing.cosim.log import LogReader
from lapwing.cosim.scene import SceneError
from lapwing.runs.resimulate import resimulate
from lapwing.services.scene_resolver import load
from tests.participants import running

TIMEOUT = 900  # [s]
FLEET = """
[run]
duration = 2.0

[communication]
rate = 250

[effects.gravity]
[effects.rotor_thrust]
[effects.ground_contact]

[[vehicle]]
name = "left"
airframe = "racer_250"
initial_position = [0.0, 5.0]
[vehicle.autopilot]
firmware = "betaflight"
port = {0}
start_timeout = 300.0
step_timeout = 300.0

[[vehicle]]
name = "right"
airframe = "racer_250"
[vehicle.autopilot]
firmware = "betaflight"
port = {1}
start_timeout = 300.0
step_timeout = 300.0

[[trajectory.phase]]
name = "arm"
duration = 0.6
[[trajectory.phase]]
name = "climb"
z = {{ kind = "minimum_jerk", to = 1.0, duration = 1.5 }}
"""


FIRMWARE = """
# Its first start accepts no connection, its second one is configured.
import socket
import sys
import time
from pathlib import Path
from betaflight_peer import Peer

first, starts = int(sys.argv[1]), Path("starts")
count = len(starts.read_text()) if starts.exists() else 0
starts.write_text("x" * (count + 1))
if count < 2:
    server = socket.socket()
    server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    server.bind(("127.0.0.1", first + 3))
    server.listen()
    if count == 0:
        time.sleep(600.0)
    client, data = server.accept()[0], b""
    while data != b"save\\n":
        client.sendall(b"# ")
        data = client.recv(4096)
else:
    with Peer(first):
        time.sleep(600.0)
"""


def options(first, **keys):
    keys = {"port": first, "start_timeout": 300.0, "step_timeout": 300.0} | keys
    return [part for key, value in keys.items() for part in ("--set", f"autopilot.{key}={value}")]


def lapwing(*arguments):
    command = [sys.executable, "-m", "lapwing", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT, check=False)


@pytest.mark.long
def test_multi_process_run_reports_firmware_and_resimulates(tmp_path):
    first, log = free_ports(), tmp_path / "flight.mcap"
    with Peer(first):
        done = lapwing(
            "run",
            "betaflight_quad",
            "--mode",
            "multi-process",
            "--log",
            log,
            "--set",
            "run.duration=3",
            *options(first),
        )
    assert "betaflight: 1501 steps" in done.stdout, done.stderr
    assert Flight.read(log).truth.position[-1, 2] > 0.1
    with LogReader(log) as read:
        assert read.metadata["repeatable"] == "no: Lapwing did not start it"
    before, after = resimulate(log)
    assert before == after


@pytest.mark.long
def test_stalled_firmware_is_reported_and_log_readable(tmp_path):
    first, log = free_ports(), tmp_path / "flight.mcap"
    with Peer(first, lambda n, reply: [reply] if n < 900 else []):
        done = lapwing("run", "betaflight_quad", "--mode", "multi-process", "--log", log, "--set", "run.duration=20",
                       *options(first, step_timeout=4.0))  # fmt: skip
    assert done.returncode == 1
    assert ": no motor outputs for 4 s at t = " in done.stderr
    assert len(Flight.read(log).truth) > 10


@pytest.mark.long
def test_firmware_whose_command_line_does_not_answer_is_started_again(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(Path.cwd()), str(Path(__file__).parent)]))
    (tmp_path / "firmware.py").write_text(FIRMWARE)
    first, log = free_ports(), tmp_path / "flight.mcap"
    command = f'["{sys.executable}", "firmware.py", "{first}"]'
    done = lapwing("run", "betaflight_quad", "--log", log, "--set", "run.duration=1",
                   *options(first, command=command, directory=f'"{tmp_path}"', repeatable="false"))  # fmt: skip
    assert "betaflight: 501 steps" in done.stdout, done.stderr
    with LogReader(log) as read:
        note = "started again: betaflight: no answer to '#' of its command line within 15 s"
        assert read.metadata["firmware_notes"] == note


@pytest.mark.long
def test_firmware_ends_with_killed_run(tmp_path):
    """Check that the kernel ends a firmware whose service was killed."""
    script = tmp_path / "firmware.py"
    script.write_text("import os, time\nopen('pid', 'w').write(str(os.getpid()))\ntime.sleep(600)\n")
    first = free_ports()
    command = [sys.executable, "-m", "lapwing", "run", "betaflight_quad", "--mode", "single-process",
               "--log", str(tmp_path / "flight.mcap"), *options(first, directory=f'"{tmp_path}"'),
               "--set", f'autopilot.command=["{sys.executable}", "{script}"]']  # fmt: skip
    run = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        pid = int(_content(tmp_path / "pid"))
    finally:
        os.kill(run.pid, signal.SIGKILL)
        run.wait()
    deadline = time.monotonic() + TIMEOUT
    while running(pid):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def _content(path):
    deadline = time.monotonic() + TIMEOUT
    while not (path.exists() and path.read_text()):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    return path.read_text()


@pytest.mark.long
def test_each_vehicle_of_fleet_has_its_firmware(tmp_path):
    one, log = free_ports(), tmp_path / "flight.mcap"
    two = one + 4
    scene = tmp_path / "fleet.toml"
    scene.write_text(FLEET.format(one, two))
    with Peer(one) as left, Peer(two) as right:
        done = lapwing("run", scene, "--mode", "single-process", "--log", log)
    assert done.stdout.count("betaflight: 501 steps") == 2, done.stderr
    assert len(left.states) > 500
    assert len(right.states) > 500
    assert all(flight.truth.position[-1, 2] > 0.1 for flight in Flight.read_all(log))
    with LogReader(log) as read:
        assert {"left/firmware", "right/firmware"} <= set(read.metadata)


@pytest.mark.long
def test_two_firmwares_with_same_ports_are_rejected(tmp_path):
    scene = tmp_path / "fleet.toml"
    scene.write_text(FLEET.format(9002, 9002))
    done = lapwing("run", scene)
    assert done.returncode == 2
    assert "vehicle.1.autopilot.port" in done.stderr
    assert "fixed ports, which left uses already" in done.stderr


def test_simulator_rejects_firmware():
    with pytest.raises(SceneError, match="betaflight flies the vehicle"):
        Simulator(load("betaflight_quad"))
