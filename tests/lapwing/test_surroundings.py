"""Runs in a broken environment: no home folder, read-only folders, a clock that jumps."""

import json
import os
import subprocess
import sys

import pytest

from lapwing.kernels import cache_folder

pytestmark = pytest.mark.long

COMMAND = [sys.executable, "-m", "lapwing", "run", "gyrostat_blocked", "--set", "run.duration=5.0"]
JUMPS = """
import itertools, time
now, jumps = time.time, itertools.cycle([0.0, 86400.0, -3600.0, -86400.0 * 365])
time.time = lambda: now() + next(jumps)
"""


def without_home(folder):
    return [], {"HOME": "/dev/null/none", "LAPWING_CACHE": str(cache_folder())}


def nothing_to_write(folder):
    """Make home, kernels and /dev/shm read-only."""
    kept = cache_folder()
    if os.geteuid() != 0 or subprocess.run(["unshare", "--mount", "true"], capture_output=True, check=False).returncode:
        pytest.skip("mounts folders read-only, as root")
    kept.mkdir(parents=True, exist_ok=True)
    closed = f"mount --bind {kept} {kept} && mount -o remount,bind,ro {kept}"
    closed += " && mount -t tmpfs -o ro none /dev/shm && mount -t tmpfs -o ro none /home"
    return ["unshare", "--mount", "sh", "-ec", f'{closed}; exec "$@"', "sh"], {"HOME": "/home"}


def clock_that_jumps(folder):
    (folder / "sitecustomize.py").write_text(JUMPS)
    return [], {"PYTHONPATH": os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])}


@pytest.fixture(scope="module")
def usual(tmp_path_factory):
    return digest(tmp_path_factory.mktemp("usual"), [], {})


def digest(folder, before, environment):
    environment = {"LAPWING_CACHE": str(cache_folder()), **environment}
    command = [*before, *COMMAND, "--log", str(folder / "log.mcap"), "--json", str(folder / "run.json")]
    done = subprocess.run(command, env={**os.environ, **environment}, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return json.loads((folder / "run.json").read_text())["digest"]


@pytest.mark.parametrize("surroundings", [without_home, nothing_to_write, clock_that_jumps])
def test_digest_is_equal_in_broken_environment(tmp_path, usual, surroundings):
    assert digest(tmp_path, *surroundings(tmp_path)) == usual
