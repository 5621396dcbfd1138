"""Quick commands do not import modules that compile, send or draw."""

import subprocess
import sys

import pytest

SLOW = {"numba", "scipy", "zenoh", "matplotlib", "plotly", "control", "pymavlink"}


@pytest.mark.parametrize("command", [["--help"], ["run", "--help"], ["scenes"]])
def test_quick_commands_do_not_import_slow_modules(command):
    output = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "lapwing", *command], capture_output=True, text=True, check=True
    ).stderr
    imported = {line.rpartition("|")[2].strip().partition(".")[0] for line in output.splitlines()}
    assert "typer" in imported
    assert not imported & SLOW
