"""A run whose services are started separately has an outcome when one of them dies."""

import json
import os
import struct
import subprocess
import sys
import time
import urllib.request

import pytest

from lapwing.cosim.log import LogReader
from lapwing.messages import Log
from lapwing.services.process_table import FOXGLOVE, required_processes
from lapwing.services.scene_resolver import load, resolve
from tests.commands import run_command
from tests.endpoints import loopback_endpoints
from tests.services.foxglove.client import patient

pytestmark = pytest.mark.long

SETS = ["--set", "run.duration=60.0"]
PATIENCE = 300.0  # [s]


def start(*words):
    command, silent = [sys.executable, "-m", "lapwing", *words], os.environ | {"BROWSER": "true"}
    return subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=silent)


@pytest.fixture(scope="module", autouse=True)
def compiled():
    """Compile the kernels first: a mission waits too short for compilation on a busy machine."""
    run_command("precompile", "hover", code=0)


def flies(log):
    """Return True if the log has reached 3 s, when all participants have joined."""
    try:
        with LogReader(log) as read:
            return any(True for _ in read.messages(start_ns=3_000_000_000))
    except ValueError:  # not there yet
        return False


def test_dead_service_is_named_and_outcome_is_aborted(tmp_path):
    names = required_processes(resolve(load("hover", SETS[1:])))
    table = ",".join(f"{name}={at}" for name, at in loopback_endpoints([*names, "mission"]).items())
    log, figures = tmp_path / "log.mcap", tmp_path / "figures.json"

    common = [*SETS, "--endpoints", table, "--insecure", "--key-prefix", "joined"]
    more = {"plant": ["--speed", "1"], "recorder": ["--log", str(log)]}
    services = {name: start("service", name, "hover", *common, *more.get(name, [])) for name in names}
    mission = start("run", "hover", *common, "--log", str(log), "--json", str(figures))
    try:
        deadline = time.monotonic() + PATIENCE
        while not flies(log) and time.monotonic() < deadline:
            time.sleep(0.1)
        services["plant"].kill()
        _, output = mission.communicate(timeout=PATIENCE)
    finally:
        for process in (*services.values(), mission):
            process.kill()
            process.communicate()
    assert mission.returncode == 1, output
    assert "plant: left the run at t = " in output
    assert json.loads(figures.read_text())["outcome"]["kind"] == "aborted"


def test_viewers_receive_events_during_flight(tmp_path):
    pytest.importorskip("foxglove", reason="needs the extra `foxglove`")
    names = required_processes(resolve(load("hover")))
    ends = loopback_endpoints([*names, FOXGLOVE, "mission", "door"])
    port = int(ends.pop("door").rpartition(":")[2])
    table, log = ",".join(f"{name}={at}" for name, at in ends.items()), tmp_path / "log.mcap"
    common = ["--set", "run.duration=3.0", "--endpoints", table, "--insecure", "--key-prefix", "told"]
    viewer = start("service", FOXGLOVE, "hover", *common, "--foxglove", f"127.0.0.1:{port}")
    started = [viewer]
    try:
        client = patient(port, viewer)
        more = {"plant": ["--speed", "1"], "recorder": ["--log", str(log)]}
        started += [start("service", name, "hover", *common, *more.get(name, [])) for name in names]
        mission = start("run", "hover", *common, "--log", str(log), "--view")
        started.append(mission)
        address = mission.stdout.readline().removeprefix("live: ").strip()
        with urllib.request.urlopen(address, timeout=PATIENCE) as page:  # its pictures: tests/lapwing/test_live.py
            assert page.status == 200
        client.subscribe("/drone1/events")
        reported = []
        while (message := client.next()) is not None:
            if isinstance(message, bytes) and message[0] == 1:
                reported.append((struct.unpack_from("<BIQ", message)[2], message[13:]))
        _, output = mission.communicate(timeout=PATIENCE)
    finally:
        for process in started:
            process.kill()
            process.communicate()
    assert mission.returncode == 0, output
    with LogReader(log) as read:
        kept = [(time_ns, payload) for _, _, time_ns, payload in read.messages(["/drone1/events"])]
    assert reported
    assert set(reported) <= set(kept)
    kinds = [Log.decode(payload).name for _, payload in reported]
    assert "arming" in kinds
