"""Participants on several hosts compare what they have resolved before they fly."""

import subprocess
import sys

from cosim.launcher import loopback_endpoints

SCENE = "scenes/gyrostat_blocked.toml"


def participant(name, peers, tmp_path, *more):
    table = ",".join(f"{key}={endpoint}" for key, endpoint in peers.items())
    command = [
        sys.executable,
        "-m",
        "lapwing",
        "service",
        name,
        SCENE,
        "--peers",
        table,
        "--key-prefix",
        "test-join",
        *more,
    ]
    return subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def test_a_participant_with_another_set_up_is_refused_and_the_first_difference_named(tmp_path):
    peers = loopback_endpoints(["plant", "recorder"])
    short = ("--set", "run.duration=50.0")
    plant = participant("plant", peers, tmp_path, *short, "--set", "gyrostat.inertia=[500.0,501.0,1000.0]")
    log = str(tmp_path / "log.mcap")
    recorder = participant("recorder", peers, tmp_path, *short, "--log", log)
    for process in (plant, recorder):
        _, said = process.communicate(timeout=120)
        assert process.returncode == 2, said
        assert "services.plant.parameters.core.system.inertia.1" in said
        assert "501.0" in said
        assert "500.0" in said
        assert len(said.splitlines()) == 1


def test_the_same_set_up_flies(tmp_path):
    peers = loopback_endpoints(["plant", "recorder"])
    log = tmp_path / "log.mcap"
    plant = participant("plant", peers, tmp_path, "--set", "run.duration=50.0")
    recorder = participant("recorder", peers, tmp_path, "--set", "run.duration=50.0", "--log", str(log))
    for process in (plant, recorder):
        _, said = process.communicate(timeout=120)
        assert process.returncode == 0, said
    assert log.stat().st_size > 1000
