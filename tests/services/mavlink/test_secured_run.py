"""Signed links, foreign protocols and links that cannot start, through the command line."""

import math
import re
import socket
import subprocess
import sys
from contextlib import contextmanager, suppress

import pytest
from fake_vehicle import free_port
from pymavlink import mavutil

from lapwing.cosim.log import LogReader
from lapwing.messages import OperatorInput
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.signing import read_key
from tests.commands import assert_rejected, run_command

pytestmark = pytest.mark.long

ARM, TAKEOFF = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_NAV_TAKEOFF
DURATION = 60  # [s] simulated, 15 s on the clock: a client may be starved


@pytest.fixture(autouse=True)
def mavlink2(monkeypatch):
    """Let pymavlink's connections use MAVLink 2, without which there are no signatures."""
    monkeypatch.setattr(mavutil, "mavlink", mavlink)


@pytest.fixture
def key(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    path = tmp_path / "key"
    path.write_text("correct horse battery staple\n")
    return path


class Station:
    """A pymavlink client that stores its sent frames."""

    def __init__(self, url, key=None):
        self.link, self.sent = mavutil.mavlink_connection(url, retries=100), []
        if key:
            self.link.setup_signing(read_key(key), sign_outgoing=True)
        write = self.link.write
        self.link.write = lambda data: (self.sent.append(bytes(data)), write(data))

    def await_vehicle(self, process):
        """Send heartbeats until the vehicle has a position."""
        while not self.link.recv_match(type="GLOBAL_POSITION_INT", blocking=True, timeout=0.5):
            assert process.poll() is None, process.stdout.read()
            self.link.mav.heartbeat_send(6, 8, 0, 0, 0)

    def command(self, number, *params, seconds=60.0):
        self.link.mav.command_long_send(1, 1, number, 0, *params, *[math.nan] * (7 - len(params)))
        while ack := self.link.recv_match(type="COMMAND_ACK", blocking=True, timeout=seconds):
            if ack.command == number:
                return ack.result


@contextmanager
def run(tmp_path, name, *options):
    log = tmp_path / f"{name}.mcap"
    sets = ("autopilot.follow_trajectory=false", f"run.duration={DURATION}")
    command = [sys.executable, "-m", "lapwing", "run", "hover", *(p for s in sets for p in ("--set", s)), *options]
    command += ["--speed", "4", "--log", str(log), "--key-prefix", f"test-secured-{name}"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        process.log = log
        try:
            yield process
        finally:
            process.kill()


def commands(log):
    with LogReader(log) as read:
        messages = read.messages(["/drone1/vehicle_command"])
        return {c.kind for *_, m in messages for c in OperatorInput.decode(m).commands}


def test_signing_client_flies_and_replayed_frames_are_rejected(tmp_path, key):
    port = free_port()
    options = ("--mavlink", f"udpin:127.0.0.1:{port}", "--mavlink-key", str(key))
    with run(tmp_path, "signed", *options) as process:
        station = Station(f"udpout:127.0.0.1:{port}", key)
        station.await_vehicle(process)
        stranger = Station(f"udpout:127.0.0.1:{port}")
        stranger.link.mav.heartbeat_send(6, 8, 0, 0, 0)
        assert stranger.command(ARM, 1.0, 0.0, seconds=1.0) is None
        assert station.command(ARM, 1.0, 0.0) == mavlink.MAV_RESULT_ACCEPTED
        assert station.command(TAKEOFF) == mavlink.MAV_RESULT_ACCEPTED
        text, _ = process.communicate(timeout=600)
    assert "unsigned, forged or replayed" in text
    assert {"arm", "takeoff"} <= commands(process.log)

    with run(tmp_path, "replayed", *options) as process, socket.socket(type=socket.SOCK_DGRAM) as thief:
        thief.connect(("127.0.0.1", port))
        observer = Station(f"udpout:127.0.0.1:{port}", key)
        observer.link.mav.srcComponent = 77  # a separate stream
        observer.await_vehicle(process)
        for frame in station.sent:
            thief.send(frame)
        text, _ = process.communicate(timeout=600)
    assert int(re.search(r"(\d+) unsigned, forged or replayed", text)[1]) >= len(station.sent)
    assert commands(process.log) <= {"link"}


@pytest.mark.nightly
def test_http_post_to_tcp_link_is_closed_and_does_not_arm(tmp_path):
    port = free_port(socket.SOCK_STREAM)
    codec = mavlink.MAVLink(None, 255, 190)
    body = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(codec)
    body += mavlink.MAVLink_command_long_message(1, 1, ARM, 0, 1.0, 21196.0, *(0.0,) * 5).pack(codec)
    head = f"POST / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nContent-Length: {len(body)}\r\n\r\n".encode()
    with run(tmp_path, "http", "--mavlink", f"tcpin:127.0.0.1:{port}") as process:
        station = Station(f"tcp:127.0.0.1:{port}")
        station.await_vehicle(process)
        with socket.create_connection(("127.0.0.1", port)) as page:
            page.settimeout(60.0)
            page.sendall(head + body)
            with suppress(ConnectionResetError):
                while page.recv(4096):
                    pass
        text, _ = process.communicate(timeout=600)
    assert "1 not MAVLink" in text
    assert commands(process.log) <= {"link"}


@pytest.mark.parametrize(
    "kind", ["mavlink", *(pytest.param(k, marks=pytest.mark.nightly) for k in ("foxglove", "ros2", "time stamps"))]
)
def test_link_that_cannot_start_ends_run_before_take_off(tmp_path, key, kind):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        (tmp_path / "file").write_text("")
        options = {
            "mavlink": ["--mavlink", f"tcpin:{address}"],
            "foxglove": ["--foxglove", address],
            "ros2": ["--ros2", "3", "--ros2-router", address],
            "time stamps": ["--mavlink", "udpout:127.0.0.1:14999", "--mavlink-key", str(key)],
        }[kind]
        log = tmp_path / "flight.mcap"
        values = {"XDG_STATE_HOME": str(tmp_path / "file")} if kind == "time stamps" else {}
        words = ["run", "hover", *options, "--log", log, "--key-prefix", "test-no-start"]
        assert_rejected(run_command(*words, **values), options[0])
    assert not log.exists()
