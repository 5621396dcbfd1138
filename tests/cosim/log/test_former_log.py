"""A log of version 0.1.0, recorded before modules, classes and scene keys were renamed (commit f1c8295)."""

import gzip
import subprocess
import sys
from pathlib import Path

import pytest

from lapwing.cosim.config.class_aliases import CLASSES, MODULES, present_name
from lapwing.cosim.config.serialise import _class_of
from lapwing.cosim.log import LogReader
from lapwing.runs.resimulate import recorded_setup

RECORDED = Path(__file__).parent / "recorded" / "hover_0_1_0.mcap.gz"  # 0.3 s of hover


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "hover.mcap"
    path.write_bytes(gzip.decompress(RECORDED.read_bytes()))
    return path


def test_former_log_reads_and_verifies(log):
    with LogReader(log) as read:
        assert read.complete
        assert read.digest() == read.metadata["digest"]
        setup = recorded_setup(read)
    assert (setup.scene, setup.rate, set(setup.services)) == ("hover", 250, {"plant", "autopilot", "trajectory"})
    assert b'"$":"cosim.setup:Setup"' in LogReader(log).attachments["setup.json"]


@pytest.mark.parametrize("command", [["verify"], ["resimulate"], ["report", "--out", "report.html"]])
def test_command_accepts_former_log(log, tmp_path, command):
    """`resimulate` succeeds only if the digest is that of the log."""
    arguments = [sys.executable, "-m", "lapwing", command[0], str(log), *command[1:]]
    done = subprocess.run(arguments, capture_output=True, text=True, timeout=300, check=False, cwd=tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", [*(f"{module}:x" for module in MODULES), *CLASSES])
def test_alias_leads_to_a_present_module_and_class(name):
    module, _, path = present_name(name).partition(":")
    assert module.startswith("lapwing.")
    __import__(module)
    if name in CLASSES:
        assert hasattr(sys.modules[module], path)


def test_declared_module_may_have_the_name_of_a_former_package(tmp_path, monkeypatch):
    (tmp_path / "dynamics.py").write_text("from typing import NamedTuple\nclass Gains(NamedTuple):\n    p: float\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert _class_of("dynamics:Gains", ["dynamics"]).__module__ == "dynamics"
    monkeypatch.delitem(sys.modules, "dynamics")
