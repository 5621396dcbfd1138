"""What the quick commands do not wait for: importing what compiles, sends and draws."""

import subprocess
import sys

import pytest

SLOW = {"numba", "scipy", "zenoh", "matplotlib", "plotly", "control", "pymavlink"}


@pytest.mark.parametrize("command", [["--help"], ["run", "--help"], ["scenes"]])
def test_quick_commands_import_nothing_slow(command):
    said = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "lapwing", *command], capture_output=True, text=True, check=True
    ).stderr
    imported = {line.rpartition("|")[2].strip().partition(".")[0] for line in said.splitlines()}
    assert "typer" in imported
    assert not imported & SLOW
