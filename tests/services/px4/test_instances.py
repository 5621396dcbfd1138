"""Several PX4 on one machine: fleets, campaigns, runs side by side. A scripted program replaces PX4."""

import json
import os
import socket
import time
from contextlib import ExitStack
from pathlib import Path

import pytest

from lapwing.api.flight import Flight
from lapwing.services.px4.link import MAVLINK_PORT, PORT
from tests.services.firmware_links import HOST, lapwing, program, scripted

SCENE = Path(__file__).parents[3] / "lapwing/scenes/px4_quad.toml"


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
def recorded(tmp_path):
    """Return the option that starts the scripted program, and the file with its starts."""
    return program(scripted("px4", "--starts", tmp_path / "starts.txt")), tmp_path / "starts.txt"


@pytest.mark.long
def test_campaign_starts_and_ends_one_program_for_each_run(recorded, tmp_path):
    command, file = recorded
    lapwing(
        "campaign", "px4_quad", "--runs", 3, "--out", tmp_path / "campaign", "--workers", 1,
        "--json", tmp_path / "c.json", *command,
        "--vary", "sensors.gps.noise_velocity_m_per_s_per_sqrt_hz=uniform(0.0,0.05)",
    )  # fmt: skip
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
def test_concurrent_run_uses_next_instance(recorded, tmp_path):
    command, file = recorded
    with ExitStack() as stack:
        for instance in range(2):  # occupied as by two other runs
            s = stack.enter_context(socket.socket())
            s.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            _bind(s, PORT + instance)
        lapwing("run", "px4_quad", "--mode", "single-process", "--log", tmp_path / "a.mcap", *command)
    ((instance, pid),) = starts(file)
    assert instance >= 2
    assert not is_running(pid)


@pytest.mark.nightly
@pytest.mark.long
def test_fleet_has_one_instance_for_each_vehicle(recorded, tmp_path):
    command, file = recorded
    scene = SCENE.read_text().replace("plans/", f"{SCENE.parent}/plans/")
    vehicles = "".join(
        f'\n[[vehicle]]\nname = "{name}"\nairframe = "quad_x"\ninitial_position = [0.0, {y}]\n'
        for name, y in (("left", 3.0), ("right", -3.0))
    )
    (tmp_path / "fleet.toml").write_text(scene.replace('[vehicle]\nairframe = "quad_x"\n', "") + vehicles)
    log = tmp_path / "fleet.mcap"
    lapwing("run", tmp_path / "fleet.toml", "--mode", "single-process", "--log", log, *command)
    started = starts(file)
    assert len({instance for instance, _ in started}) == len(started) == 2
    for flight in Flight.read_all(log):
        assert flight.outcome.kind == "landed"
        assert flight.truth.position[:, 2].max() > 1.0
        assert "skew 0 ms, resent 0, late 0, missed 0" in str(flight.metadata)
    lapwing("resimulate", log)
    assert MAVLINK_PORT + max(instance for instance, _ in started) < MAVLINK_PORT + 10
