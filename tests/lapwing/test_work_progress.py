"""Progress bar of `fly`, `Simulator` and `campaign` in the terminal of a process."""

import os
import pty
import re
import subprocess
import sys

import pytest

SLOW = """
import time
from lapwing.plugins import ThrustAndMoments

class Slow:
    rate = 125.0

    def __init__(self, vehicle):
        self.weight = vehicle.mass * vehicle.gravity

    def step(self, clock, estimate, setpoint):
        time.sleep(0.02)
        return ThrustAndMoments(self.weight, (0.0, 0.0, 0.0))
"""
SCENE = "'hover', {'run.duration': 2.0, 'autopilot.controller': 'slow:Slow'}"  # 250 calls, 5 s and more
FLY = f"import lapwing; print(lapwing.fly({SCENE}).digest)"
CALLS = {
    "fly": (FLY, r"hover: \d+\.\d of 2 s"),
    "campaign": (
        f"import lapwing; lapwing.campaign({SCENE.replace(', {', ', range(4), overrides={')})",
        "of 4 flights",
    ),
    "simulator": (
        f"import lapwing; s = lapwing.Simulator({SCENE.replace('2.0', '4.0')});"
        "at = lapwing.Setpoint(position_world=(0.0, 0.0, 1.0));"
        "s.step(setpoint=at); s.step(setpoint=at, ticks=500)",
        r"hover: \d+\.\d of 2 s",
    ),
}


def run(code, folder, terminal):
    """Run code with its errors on a terminal or a pipe; return (standard output, errors)."""
    (folder / "slow.py").write_text(SLOW)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(folder), os.getcwd()]), "TERM": "xterm"}
    controller, inner = pty.openpty() if terminal else os.pipe()
    try:
        process = subprocess.Popen(
            [sys.executable, "-c", code], cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=inner, text=True
        )
        os.close(inner)
        errors = b""
        while True:
            try:
                data = os.read(controller, 65536)
            except OSError:  # the terminal's other end is closed
                break
            if not data:
                break
            errors += data
        output = process.stdout.read()
        assert process.wait() == 0, errors
        return output, errors.decode()
    finally:
        os.close(controller)


@pytest.mark.long
@pytest.mark.parametrize("name", CALLS)
def test_bar_appears_in_terminal_while_work_is_long(name, tmp_path):
    code, expected = CALLS[name]
    _, errors = run(code, tmp_path, terminal=True)
    assert re.search(expected, errors), errors


@pytest.mark.long
def test_bar_changes_neither_digest_nor_piped_output(tmp_path):
    with_bar, _ = run(FLY, tmp_path, terminal=True)
    without, errors = run(FLY, tmp_path, terminal=False)
    assert with_bar == without
    assert errors == ""
