"""A signed link of services that are started separately, and of a replay."""

import os
import subprocess
import sys

import pytest
from fake_vehicle import free_port
from pymavlink import mavutil

from lapwing.cosim.log import LogReader
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.signing import read_key
from lapwing.services.process_table import MAVLINK, required_processes
from lapwing.services.scene_resolver import load, resolve
from tests.endpoints import loopback_endpoints

pytestmark = pytest.mark.long

HOVER, PLAN = "lapwing/scenes/hover.toml", "lapwing/scenes/plans/delivery.plan"
SETS = ["run.duration=5.0", "success.require=[]"]
PATIENCE = 300.0  # [s]


@pytest.fixture
def key(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setattr(mavutil, "mavlink", mavlink)  # MAVLink 1 has no signatures
    path = tmp_path / "key"
    path.write_text("correct horse battery staple\n")
    return path


def start(*arguments):
    command = [sys.executable, "-m", "lapwing", *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=dict(os.environ))


def signed_position(station, key, process):
    """Return a position from a signed frame."""
    station.setup_signing(read_key(key), sign_outgoing=True)
    while process.poll() is None:
        message = station.recv_match(type="GLOBAL_POSITION_INT", blocking=True, timeout=1.0)
        if message is not None:
            assert message.get_signed()
            return message
    raise AssertionError(process.stdout.read())


def test_separate_link_is_signed_and_serves_plan(tmp_path, key):
    port, log = free_port(), tmp_path / "log.mcap"
    station = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}")
    names = [*required_processes(resolve(load(HOVER, SETS))), MAVLINK]
    table = ",".join(f"{name}={at}" for name, at in loopback_endpoints([*names, "mission"]).items())
    common = [HOVER, *(p for each in SETS for p in ("--set", each)), "--plan", PLAN, "--endpoints", table]
    common += ["--insecure", "--key-prefix", "test-separate"]
    more = {
        "plant": ["--speed", "1"],
        "recorder": ["--log", log],
        MAVLINK: ["--mavlink", f"udpout:127.0.0.1:{port}", "--mavlink-key", key],
    }
    services = {name: start("service", name, *common, *more.get(name, [])) for name in names}
    run = start("run", *common, "--log", log)
    try:
        signed_position(station, key, services[MAVLINK])
        station.mav.heartbeat_send(6, 8, 0, 0, 0)
        station.mav.mission_request_list_send(1, 1, 0)
        count = station.recv_match(type="MISSION_COUNT", blocking=True, timeout=PATIENCE)
        text, _ = run.communicate(timeout=PATIENCE)
    finally:
        for process in (*services.values(), run):
            process.kill()
            process.communicate()
        station.close()
    assert count.count > 3
    assert run.returncode == 0, text
    with LogReader(log) as read:
        assert read.complete


def test_replay_signs_its_link(tmp_path, key):
    port, log = free_port(), tmp_path / "log.mcap"
    short = ["--set", "run.duration=1.0", "--set", "success.require=[]"]
    flight = start("run", HOVER, *short, "--mode", "single-process", "--log", log)
    text, _ = flight.communicate(timeout=PATIENCE)
    assert flight.returncode == 0, text
    station = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}")
    (endpoint,) = loopback_endpoints(["a"]).values()
    replay = start(
        "replay", log, "--loop", "--listen", endpoint, "--key-prefix", "test-signed-replay",
        "--mavlink", f"udpout:127.0.0.1:{port}", "--mavlink-key", key,
    )  # fmt: skip
    try:
        signed_position(station, key, replay)
    finally:
        replay.kill()
        replay.communicate()
        station.close()
