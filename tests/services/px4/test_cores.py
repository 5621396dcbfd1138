"""Core that Lapwing shares with a firmware in lock step, observed by a scripted program in flight."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

PEER = Path(__file__).parent / "scripted_px4.py"
pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(
        sys.platform != "linux" or len(os.sched_getaffinity(0)) < 2, reason="one core, or no affinity of threads"
    ),
]


def fly(tmp_path, *arguments):
    """Fly. Return the cores of the program, of Lapwing's main thread, and of its other threads."""
    file = tmp_path / "cores.txt"
    command = [sys.executable, str(PEER), "--cores", str(file)]
    done = subprocess.run(
        [sys.executable, "-m", "lapwing", *arguments, "--set", f"autopilot.command={json.dumps(command)}"],
        capture_output=True, text=True, timeout=1200, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    program, main, *others = file.read_text().split()
    return program, main, set(others)


def test_firmware_and_exchanging_thread_share_a_core(tmp_path):
    log = str(tmp_path / "a.mcap")
    program, main, others = fly(tmp_path, "run", "px4_quad", "--mode", "single-process", "--log", log)
    assert program == main
    assert int(main) in os.sched_getaffinity(0)
    assert others  # the log's thread, at least
    assert main not in others


def test_firmware_runs_on_core_of_services(tmp_path):
    log = str(tmp_path / "a.mcap")
    program, main, _ = fly(tmp_path, "run", "px4_quad", "--mode", "multi-process", "--log", log)
    assert program == main
    assert int(main) in os.sched_getaffinity(0)
