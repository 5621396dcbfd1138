"""A scene starts without compilation after a run or `precompile`."""

import json
import subprocess
import sys

import pytest

pytestmark = pytest.mark.long

RUN = """
import json, sys
from lapwing.cli.main import main
from lapwing.kernels import on_compile
from lapwing.kernels.compiler import cache_files
compiled, looked_up, read = [], [], cache_files.read
def watched(folder, name, version):
    if folder.startswith("kernels/"):
        looked_up.append(f"{folder}/{name} {version}")
    return read(folder, name, version)
cache_files.read = watched
on_compile(compiled.append)
main()
print(json.dumps([compiled, looked_up]))
"""

# Forked children inherit these changes. Each writes the kernels that it looks up, and its name once it has joined.
JOINS = """
import sys
from pathlib import Path
from lapwing.cosim.executors.participant import Participant
from lapwing.kernels.compiler import cache_files
from lapwing.cli.main import app
joined, join, told, read = [], Participant.join, Path(sys.argv[1]), cache_files.read
def watched_join(process, *given):
    join(process, *given)
    joined.append(process.name)
def watched_read(folder, name, version):
    if folder.startswith("kernels/"):
        with told.open("a") as stream:
            stream.write(f"{folder}/{name} {' '.join(joined)}\\n")
    return read(folder, name, version)
Participant.join, cache_files.read = watched_join, watched_read
app(sys.argv[2:], standalone_mode=False)
"""


def kernels(*words):
    """Return (compiled kernels, kernels looked up) of a command."""
    run = subprocess.run([sys.executable, "-c", RUN, *words], check=True, capture_output=True, text=True)
    return json.loads(run.stdout.splitlines()[-1])


def flown(folder):
    """Return (compiled kernels, kernels looked up) of a run."""
    return kernels(
        "run", "hover", "--mode", "single-process", "--set", "run.duration=0.2", "--log", str(folder / "log.mcap")
    )


def test_second_run_does_not_compile(tmp_path):
    flown(tmp_path)
    compiled, looked_up = flown(tmp_path)
    assert compiled == []
    assert looked_up


def test_precompile_covers_all_kernels_of_run(tmp_path):
    """Compare looked-up kernels in the shared cache; a new cache would compile all kernels again."""
    _, ahead = kernels("precompile", "hover")
    compiled, looked_up = flown(tmp_path)
    assert compiled == []
    assert set(looked_up) <= set(ahead)


@pytest.mark.skipif(sys.platform != "linux", reason="processes are not forked")
@pytest.mark.parametrize("scene", ["hover", "delivery_mission"])
def test_joined_process_looks_up_no_kernel(tmp_path, scene):
    """An empty cache makes a process compile a kernel that it looks up after joining."""
    words = ["run", scene, "--set", "run.duration=0.5", "--set", "success.require=[]", "--log", tmp_path / "log.mcap"]
    subprocess.run([sys.executable, "-c", JOINS, tmp_path / "told", *words], check=True, capture_output=True)
    looked_up = [line.split(" ") for line in (tmp_path / "told").read_text().splitlines()]
    assert any(kernel.startswith("kernels/lapwing.cosim.diagram.compiled_loop/run-") for kernel, _ in looked_up)
    assert [(kernel, process) for kernel, process in looked_up if process] == []
