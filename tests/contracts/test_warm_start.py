"""A scene that has been flown once starts without compiling anything."""

import json
import os
import subprocess
import sys

FLY = """
import json, sys
from lapwing.cli.main import app
from dynamics.kernel import on_compile
compiled = []
on_compile(compiled.append)
app(sys.argv[1:], standalone_mode=False)
print(json.dumps(compiled))
"""


def compiled(folder, scene="hover", **environment):
    """The kernels that a run compiles, from its command to its end."""
    log = str(folder / "log.mcap")
    return _compiled("run", scene, "--mode", "single", "--set", "run.duration=0.2", "--log", log, **environment)


def _compiled(*words, **environment):
    environment = {**os.environ, **environment}
    command = [sys.executable, "-c", FLY, *words]
    run = subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
    return json.loads(run.stdout.splitlines()[-1])


def test_the_second_run_compiles_nothing(tmp_path):
    compiled(tmp_path)
    assert compiled(tmp_path) == []


def test_the_first_run_after_compiling_ahead_compiles_nothing(tmp_path):
    own = {"LAPWING_CACHE": str(tmp_path / "cache")}
    assert _compiled("warm", "hover", **own)
    assert compiled(tmp_path, **own) == []
