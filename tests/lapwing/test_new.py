"""`lapwing new`: the created files work in every mode, and no file is overwritten."""

import ast
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from lapwing.cli.new_command import write_module
from lapwing.cosim.log import LogReader
from lapwing.dynamics.config_error import ConfigError
from lapwing.runs.multi_process_run import fly_processes
from lapwing.runs.observer import Silent
from lapwing.runs.resimulate import resimulate
from lapwing.services.process_main import ProcessSpec
from lapwing.services.scene_resolver import from_resolved, load, resolve
from lapwing.studies.simulate import fly
from tests.commands import assert_rejected, run_command

pytestmark = pytest.mark.long

NAME = "tether_drag"


@pytest.fixture
def scene(tmp_path):
    """Return a function that loads the hover scene with a new effect."""
    write_module("effect", NAME, tmp_path)
    path = tmp_path / "hover.toml"
    path.write_text(Path("lapwing/scenes/hover.toml").read_text() + f'\n[effects.{NAME}]\nmodule = "{NAME}"\n')
    return lambda *overrides: load(path, ["run.duration=1.5", *overrides])


def flat(tables, path=""):
    """Yield dotted key and value of each entry."""
    for key, value in tables.items():
        if isinstance(value, dict):
            yield from flat(value, f"{path}{key}.")
        else:
            yield f"{path}{key}", value


@pytest.mark.parametrize("kind", ["effect", "sensor", "controller", "estimator", "segment"])
def test_created_module_passes_its_test(tmp_path, kind):
    created = run_command("new", kind, f"my_{kind}", folder=tmp_path)
    assert (created.returncode, created.stderr) == (0, "")
    assert created.stdout.split() == [f"my_{kind}.py", f"test_my_{kind}.py"]
    tests = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "."]
    result = subprocess.run(tests, cwd=tmp_path, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout


@pytest.mark.parametrize("kind", ["effect", "sensor", "controller", "estimator", "segment"])
def test_created_module_flies_by_its_first_lines(tmp_path, kind):
    run_command("new", kind, f"my_{kind}", folder=tmp_path, code=0)
    text = ast.get_docstring(ast.parse((tmp_path / f"my_{kind}.py").read_text()))
    tables = tomllib.loads("\n".join(line for line in text.splitlines() if line.startswith("    ")))
    scene = tmp_path / "my_flight.toml"
    scene.write_text(Path("lapwing/scenes/hover.toml").read_text())
    options = []
    if kind == "segment":
        first, separator, others = scene.read_text().rpartition("[[trajectory.phase]]")
        assert tables["trajectory"]["phase"][0]["x"]["kind"] == "my_segment"
        table = text[text.index("[[trajectory.phase]]") :]
        scene.write_text(f"{first}{table}\n\n{separator}{others}")
    else:
        for key, value in flat(tables):
            options += ["--set", f"{key}={json.dumps(value)}"]
    run_command("run", "my_flight.toml", "--mode", "single-process", *options, folder=tmp_path, code=0)


def test_created_scene_flies(tmp_path):
    assert run_command("new", "scene", "my_flight", folder=tmp_path).stdout.startswith("my_flight.toml\nnext:\n")
    unknown = run_command("check", "my_flight", folder=tmp_path, code=2).stderr
    assert "unknown scene 'my_flight'; did you mean my_flight.toml? expected one of " in unknown
    result = run_command("run", "my_flight.toml", "--mode", "single-process", folder=tmp_path, code=0)
    assert re.search(r"Landed .* ends at \(6\.00, 4\.00, ", " ".join(result.stdout.split()))
    assert_rejected(run_command("new", "scene", "my_flight", folder=tmp_path))


def test_created_scene_has_its_own_title_and_valid_further_tables(tmp_path):
    run_command("new", "scene", "my_flight", folder=tmp_path)
    path = tmp_path / "my_flight.toml"
    assert load(path).lookup("run.title") == "my flight: a first flight"
    text = re.sub(r"^# (?=\[|[a-z_]+ = )", "", path.read_text(), flags=re.MULTILINE)
    assert {"wind_dryden", "battery", "body_drag"} <= set(load_text(tmp_path / "all.toml", text)["effects"])


def load_text(path, text):
    path.write_text(text)
    return load(path).resolved


def test_existing_file_is_kept(tmp_path):
    (tmp_path / f"test_{NAME}.py").write_text("mine")
    with pytest.raises(ValueError, match="already exists"):
        write_module("effect", NAME, tmp_path)
    assert not (tmp_path / f"{NAME}.py").exists()


@pytest.mark.parametrize("name", ["Tether", "tether-drag", "gravity", "numpy", "3d"])
def test_invalid_names_are_rejected(tmp_path, name):
    with pytest.raises(ValueError, match="NAME"):
        write_module("effect", name, tmp_path)
    assert not any(tmp_path.iterdir())


def test_template_digest_is_equal_in_processes_and_resimulation(scene, tmp_path):
    own, log = scene(f"effects.{NAME}.coefficient=3.0"), tmp_path / "log.mcap"
    without = fly(scene(f"effects.{NAME}.coefficient=0.0")).digest
    values = ProcessSpec("mission", resolve(own), {}, "test-own-effect", log=str(log))
    (tmp_path / f"{NAME}.py").unlink()
    fly_processes(values, Silent())
    with LogReader(log) as read:
        assert read.digest() == fly(from_resolved(own.resolved, "hover")).digest
    with pytest.raises(ValueError, match="contains code of its author"):
        resimulate(log)
    before, after = resimulate(log, allow_code=True)
    assert before == after
    assert without != before


def test_template_errors_are_one_line(scene, tmp_path):
    with pytest.raises(ConfigError, match=r"effects.tether_drag.coefficient: expected a number at least 0"):
        scene(f"effects.{NAME}.coefficient=-1.0")
    with pytest.raises(ConfigError, match=r"effects.other.module: tether_drag has no class Other"):
        scene(f"effects.other.module={NAME}")
    with pytest.raises(ConfigError, match=r"effects.other.module: no module nobody_has_this"):
        scene("effects.other.module=nobody_has_this")
    with pytest.raises(ConfigError, match=r"effects.gravity.module: gravity is the name of a shipped effect"):
        scene(f"effects.gravity.module={NAME}")
    (tmp_path / f"{NAME}.py").write_text("1 +")
    with pytest.raises(ConfigError, match=r"effects.tether_drag.module: tether_drag.py, line 1: invalid syntax"):
        scene()
