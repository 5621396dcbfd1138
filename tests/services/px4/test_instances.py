"""Several PX4 on one machine: fleets, campaigns, runs side by side. A scripted program replaces PX4."""

import json
import os
import socket
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import pytest

from lapwing.flight import Flight
from lapwing.services.common.firmware.link import FirmwareError
from lapwing.services.common.firmware.setup import first_free
from lapwing.services.px4.connection import MAVLINK_PORT, PORT
from tests.services.firmware_links import HOST, firmware_setup

PEER = Path(__file__).parent / "scripted_px4.py"
SCENE = Path(__file__).parents[3] / "lapwing/scenes/px4_quad.toml"


def claim(used):
    def result(setup):
        if setup.instance in used:
            raise FirmwareError(f"px4: instance {setup.instance} is in use")
        return setup.instance

    return result


def test_next_free_instance_is_used():
    setup, actual = first_free(firmware_setup("px4", None, 2, chooses=True), 10, claim({2, 3}))
    assert (setup.instance, actual) == (4, 4)


def test_configured_instance_is_the_only_candidate():
    with pytest.raises(FirmwareError, match="instance 2 is in use"):
        first_free(firmware_setup("px4", None, 2), 10, claim({2}))


def test_last_instance_is_reported_if_all_are_in_use():
    with pytest.raises(FirmwareError, match="instance 9 is in use"):
        first_free(firmware_setup("px4", None, 0, chooses=True), 10, claim(set(range(10))))


def lapwing(*arguments):
    command = [sys.executable, "-m", "lapwing", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=1200, check=False)


def starts(file):
    """Return (instance, process id) of every start of the scripted program."""
    return [tuple(map(int, line.split())) for line in file.read_text().splitlines()]


def is_running(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.fixture
def program(tmp_path):
    """Return the override that starts the scripted program, and the file with its starts."""
    command = [sys.executable, str(PEER), "--starts", str(tmp_path / "starts.txt")]
    return f"autopilot.command={json.dumps(command)}", tmp_path / "starts.txt"


@pytest.mark.long
def test_campaign_starts_and_ends_one_program_for_each_run(program, tmp_path):
    command, file = program
    out = tmp_path / "campaign"
    done = lapwing(
        "campaign", "px4_quad", "--runs", "3", "--out", str(out), "--workers", "1", "--json", str(tmp_path / "c.json"),
        "--set", command, "--vary", "sensors.gps.noise_velocity_m_per_s_per_sqrt_hz=uniform(0.0,0.05)",
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    started = starts(file)
    assert len(started) == 3
    assert len({pid for _, pid in started}) == len(started)
    assert not [pid for _, pid in started if is_running(pid)]
    assert json.loads((tmp_path / "c.json").read_text())["runs"] == 3


def _bind(s, port):
    """Listen at the port; wait for another run that uses it."""
    deadline = time.monotonic() + 300.0
    while True:
        try:
            s.bind((HOST, port))
            s.listen()
            return
        except OSError:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.1)


@pytest.mark.long
def test_concurrent_run_uses_next_instance(program, tmp_path):
    command, file = program
    with ExitStack() as stack:
        for instance in range(2):  # occupied as by two other runs
            s = stack.enter_context(socket.socket())
            s.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            _bind(s, PORT + instance)
        done = lapwing("run", "px4_quad", "--mode", "single-process", "--log", str(tmp_path / "a.mcap"),
                       "--set", command)  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    ((instance, pid),) = starts(file)
    assert instance >= 2
    assert not is_running(pid)


@pytest.mark.long
def test_fleet_has_one_instance_for_each_vehicle(program, tmp_path):
    command, file = program
    scene = SCENE.read_text().replace("plans/", f"{SCENE.parent}/plans/")
    vehicles = "".join(
        f'\n[[vehicle]]\nname = "{name}"\nairframe = "quad_x"\ninitial_position = [0.0, {y}]\n'
        for name, y in (("left", 3.0), ("right", -3.0))
    )
    (tmp_path / "fleet.toml").write_text(scene.replace('[vehicle]\nairframe = "quad_x"\n', "") + vehicles)
    log = tmp_path / "fleet.mcap"
    done = lapwing("run", str(tmp_path / "fleet.toml"), "--mode", "single-process", "--log", str(log), "--set", command)
    assert done.returncode == 0, done.stdout + done.stderr
    started = starts(file)
    assert len({instance for instance, _ in started}) == len(started) == 2
    for flight in Flight.read_all(log):
        assert flight.outcome.kind == "landed"
        assert flight.truth.position[:, 2].max() > 1.0
        assert "skew 0 ms, resent 0, late 0, missed 0" in str(flight.metadata)
    again = lapwing("resimulate", str(log))
    assert again.returncode == 0, again.stdout + again.stderr
    assert MAVLINK_PORT + max(instance for instance, _ in started) < MAVLINK_PORT + 10
