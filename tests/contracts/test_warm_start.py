"""A scene that has been flown once, or compiled ahead, starts without compiling anything."""

import json
import subprocess
import sys

import pytest

pytestmark = pytest.mark.long

RUN = """
import json, sys
from lapwing.cli.main import app
from dynamics.kernel import _files, on_compile
compiled, looked_up, read = [], [], _files.read
def watched(folder, name, version):
    if folder.startswith("kernels/"):
        looked_up.append(f"{folder}/{name} {version}")
    return read(folder, name, version)
_files.read = watched
on_compile(compiled.append)
app(sys.argv[1:], standalone_mode=False)
print(json.dumps([compiled, looked_up]))
"""


def kernels(*words):
    """Of a command from its beginning to its end: (the kernels that it compiles, those that it looks up)."""
    run = subprocess.run([sys.executable, "-c", RUN, *words], check=True, capture_output=True, text=True)
    return json.loads(run.stdout.splitlines()[-1])


def flown(folder):
    """The same of a run."""
    return kernels("run", "hover", "--mode", "single", "--set", "run.duration=0.2", "--log", str(folder / "log.mcap"))


def test_the_second_run_compiles_nothing(tmp_path):
    flown(tmp_path)
    compiled, looked_up = flown(tmp_path)
    assert compiled == []
    assert looked_up


def test_a_run_needs_nothing_that_compiling_ahead_does_not_look_up(tmp_path):
    """And hence compiles, and keeps: without a cache of its own, for which all would be compiled once more."""
    _, ahead = kernels("warm", "hover")
    compiled, looked_up = flown(tmp_path)
    assert compiled == []
    assert set(looked_up) <= set(ahead)
