"""A process that is stopped before it reads its specification ends the run with its name."""

import os
import signal
import subprocess
import sys
import time

import pytest

from tests.participants import participants

SCENE = "formation"  # its specification is larger than the buffer of a pipe


@pytest.mark.long
def test_process_stopped_before_its_specification_is_named(tmp_path):
    command = [sys.executable, "-m", "lapwing", "run", SCENE, "--log", str(tmp_path / "a.mcap")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as launcher:
        while "plant" not in (names := participants(launcher.pid)):
            assert launcher.poll() is None
            time.sleep(0.005)
        os.kill(names["plant"], signal.SIGSTOP)
        try:
            _, error = launcher.communicate(timeout=300.0)
        except subprocess.TimeoutExpired:
            os.kill(names["plant"], signal.SIGKILL)
            launcher.kill()
            raise
    assert launcher.returncode == 1
    assert error.startswith("lapwing: plant: stopped for 2.5 s, at t = 0.000 s")
