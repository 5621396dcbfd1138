"""MAVProxy, an independent ground station, on the link, and its log of the session."""

import importlib.util
import socket
import subprocess
import sys
import time
from pathlib import Path

import pymavlink
import pytest
from fake_vehicle import flying, free_port, until

pytestmark = pytest.mark.long

if importlib.util.find_spec("MAVProxy") is None:
    pytest.skip("MAVProxy is not installed: pip install -e .[clients]", allow_module_level=True)

BIN = Path(sys.executable).parent
MISSION = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t40.7686\t14.7907\t280\t1
1\t0\t3\t16\t1\t2\t0\t0\t40.7687\t14.7907\t6\t1
2\t0\t3\t20\t0\t0\t0\t0\t0\t0\t0\t1
"""


class Console:
    """MAVProxy with typed commands."""

    def __init__(self, port, folder):
        self.output = folder / "output.txt"
        self._file = self.output.open("w")
        command = [BIN / "mavproxy.py", f"--master=tcp:127.0.0.1:{port}", "--logfile=flight.tlog", "--state-basedir=."]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=self._file, stderr=subprocess.STDOUT, text=True, cwd=folder
        )

    def type(self, line):
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()

    def shows(self, text, seconds=60.0):
        return until(lambda: text in self.output.read_text(), seconds)

    def end(self):
        self._process.stdin.close()
        try:
            self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._file.close()


@pytest.fixture
def station(tmp_path):
    """Return a function that starts a vehicle and MAVProxy on its link."""
    ends = []

    def start(*overrides):
        port = free_port(socket.SOCK_STREAM)
        context = flying(f"tcpin:127.0.0.1:{port}", speed=2.0, overrides=overrides)
        running = context.__enter__()
        console = Console(port, tmp_path)
        ends.extend([lambda: context.__exit__(None, None, None), console.end])
        assert console.shows("online system 1"), console.output.read_text()
        return running, console

    yield start
    for end in reversed(ends):
        end()


def test_missions_parameters_arming_and_log(station, tmp_path):
    (tmp_path / "mission.txt").write_text(MISSION)
    running, console = station()
    assert console.shows(f"Received {len(running.hub.adapter.parameters.names)} parameters")
    console.type("wp load mission.txt")
    assert console.shows("MISSION_ACK: TYPE_MISSION: ACCEPTED")
    console.type("wp list")
    assert console.shows("16 3 40.7687")
    assert [item.action for item in running.vehicle.items] == ["waypoint", "waypoint", "return"]
    console.type("param set MPC_XY_P 1.5")
    assert until(lambda: running.vehicle.parameters["MPC_XY_P"] == 1.5)
    console.type("param show MPC_XY_P")
    assert console.shows("MPC_XY_P         1.5")
    console.type("arm throttle")
    assert console.shows("ARMED")
    assert running.vehicle.armed
    assert "fence breach" not in console.output.read_text()
    assert set(running.counts) == {"received"}  # nothing rejected

    time.sleep(1.0)
    console.end()
    log = next(tmp_path.rglob("flight.tlog"))
    mavlogdump = Path(pymavlink.__file__).parent / "tools" / "mavlogdump.py"
    output = subprocess.run(
        [sys.executable, mavlogdump, "--types", "GLOBAL_POSITION_INT,HEARTBEAT", str(log)],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    ).stdout
    assert output.count("GLOBAL_POSITION_INT {") > 50
    assert "autopilot : 12" in output


def test_arducopter_modes(station):
    """Set modes of ArduPilot; MAVProxy cannot set PX4's modes, which have two numbers."""
    running, console = station("mavlink.firmware=ardupilot")
    console.type("arm throttle")
    assert until(lambda: running.vehicle.armed)
    for name, mode in {"LOITER": "position_control", "RTL": "return", "LAND": "land"}.items():
        console.type(f"mode {name}")
        assert until(lambda mode=mode: running.vehicle.mode == mode), name
        assert console.shows(f"{name}>"), console.output.read_text()  # the prompt
        running.vehicle.armed = True
        running.vehicle.position[2] = 30.0
