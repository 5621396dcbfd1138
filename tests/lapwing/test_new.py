"""`lapwing new effect`: what it writes works, in every mode, and overwrites nothing."""

import subprocess
import sys
from pathlib import Path

import pytest

from lapwing.cli.new_command import write_effect
from lapwing.cosim.log import LogReader
from lapwing.dynamics.config_error import ConfigError
from lapwing.runs.multi_process_run import fly_processes
from lapwing.runs.observer import Silent
from lapwing.runs.resimulate import resimulate
from lapwing.services.process_main import ProcessSpec
from lapwing.services.scene_resolver import from_resolved, load, resolve
from lapwing.studies.simulate import fly

pytestmark = pytest.mark.long

NAME = "tether_drag"


@pytest.fixture
def scene(tmp_path):
    """Loads the hover scene with a new effect beside it."""
    write_effect(NAME, tmp_path)
    path = tmp_path / "hover.toml"
    path.write_text(Path("scenes/hover.toml").read_text() + f'\n[effects.{NAME}]\nmodule = "{NAME}"\n')
    return lambda *overrides: load(path, ["run.duration=1.5", *overrides])


def test_the_test_that_is_written_passes(tmp_path):
    write_effect(NAME, tmp_path)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(tmp_path)]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout
    assert "3 passed" in run.stdout


def test_nothing_is_overwritten(tmp_path):
    (tmp_path / f"test_{NAME}.py").write_text("mine")
    with pytest.raises(ValueError, match="is there already"):
        write_effect(NAME, tmp_path)
    assert not (tmp_path / f"{NAME}.py").exists()


@pytest.mark.parametrize("name", ["Tether", "tether-drag", "gravity", "numpy", "3d"])
def test_other_names_are_refused(tmp_path, name):
    with pytest.raises(ValueError, match="NAME"):
        write_effect(name, tmp_path)
    assert not any(tmp_path.iterdir())


def test_it_flies_to_the_same_bits_in_processes_and_from_the_log_alone(scene, tmp_path):
    own, log = scene(f"effects.{NAME}.coefficient=3.0"), tmp_path / "log.mcap"
    without = fly(scene(f"effects.{NAME}.coefficient=0.0")).digest
    given = ProcessSpec("mission", resolve(own), {}, "test-own-effect", log=str(log))
    (tmp_path / f"{NAME}.py").unlink()
    fly_processes(given, Silent())
    with LogReader(log) as read:
        assert read.digest() == fly(from_resolved(own.resolved, "hover")).digest
    with pytest.raises(ValueError, match="carries code of its author"):
        resimulate(log)
    before, after = resimulate(log, allow_code=True)
    assert before == after
    assert without != before


def test_what_is_wrong_is_one_line(scene, tmp_path):
    with pytest.raises(ConfigError, match=r"effects.tether_drag.coefficient: expected a number at least 0"):
        scene(f"effects.{NAME}.coefficient=-1.0")
    with pytest.raises(ConfigError, match=r"effects.other.module: tether_drag has no class Other"):
        scene(f"effects.other.module={NAME}")
    with pytest.raises(ConfigError, match=r"effects.other.module: no module nobody_has_this"):
        scene("effects.other.module=nobody_has_this")
    with pytest.raises(ConfigError, match=r"effects.gravity.module: gravity is the name of an effect that ships"):
        scene(f"effects.gravity.module={NAME}")
    (tmp_path / f"{NAME}.py").write_text("1 +")
    with pytest.raises(ConfigError, match=r"effects.tether_drag.module: tether_drag.py, line 1: invalid syntax"):
        scene()
