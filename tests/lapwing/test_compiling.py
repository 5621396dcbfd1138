"""Compiling is told with a guess and a bar, and only where something compiles."""

import io
import json
import random
from pathlib import Path

import pytest
from rich.console import Console
from typer.testing import CliRunner

from lapwing.cli.main import app
from lapwing.cli.progress import RunProgress
from lapwing.kernels import kernel
from lapwing.runs import compile_notice, precompile
from lapwing.runs.compile_notice import EACH, FILE, Compilation, notify_on_compile
from lapwing.runs.precompile import compile_ahead
from lapwing.services.scene_resolver import load, resolve

SERVICES = ("plant", "autopilot", "trajectory")  # of the hover scene


@pytest.fixture(scope="module")
def setup():
    return resolve(load("hover"))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(compile_notice, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(compile_notice, "slowness", lambda: 1.0)
    return tmp_path


def compile_something():
    new = random.random()  # the cache has none with this constant

    @kernel
    def times(x):
        return new * x

    assert times(1.0) == new
    assert times(2) == 2.0 * new


class Compiling:
    """Stands for a graph: compiles when it is made, and has a tick to run."""

    def __init__(self, *_):
        compile_something()

    def advance(self, _):
        pass


def test_compile_notice_appears_once_and_only_when_needed(setup, folder):
    output = []
    with notify_on_compile(setup, output.append):
        pass
    assert output == []
    assert not (folder / FILE).exists()
    with notify_on_compile(setup, output.append):
        compile_something()
    assert output == [Compilation("hover", SERVICES, EACH * len(SERVICES))]


def test_compile_notice_estimates_from_earlier_time(setup, folder):
    with notify_on_compile(setup, lambda _: None):
        compile_something()
    (key,) = known = json.loads((folder / FILE).read_text())
    assert 0.0 <= known[key] < EACH
    (folder / FILE).write_text(json.dumps({key: 81.5}))
    output = []
    with notify_on_compile(setup, output.append):
        compile_something()
    assert [what.seconds for what in output] == [81.5]
    assert json.loads((folder / FILE).read_text()) == {key: 81.5}


def test_estimate_follows_present_speed_of_machine(setup, folder, monkeypatch):
    with notify_on_compile(setup, lambda _: None):
        compile_something()
    (key,) = json.loads((folder / FILE).read_text())
    (folder / FILE).write_text(json.dumps({key: 20.0}))
    monkeypatch.setattr(compile_notice, "slowness", lambda: 7.0)
    output = []
    with notify_on_compile(setup, output.append):
        compile_something()
    assert [what.seconds for what in output] == [140.0]
    assert json.loads((folder / FILE).read_text()) == {key: 20.0}


def test_slowness_is_positive_measurement():
    assert compile_notice.slowness() > 0.0


@pytest.mark.parametrize("content", ["", "[]", '{"a": []}'])
def test_damaged_memory_is_none(setup, folder, content):
    (folder / FILE).write_text(content)
    output = []
    with notify_on_compile(setup, output.append):
        compile_something()
    assert output == [Compilation("hover", SERVICES, EACH * len(SERVICES))]


def test_terminal_has_bar_and_anything_else_line():
    for terminal, expected in (
        (True, "of about 40 s"),
        (False, "hover: compiling kernels of plant, sensors, about 40 s"),
    ):
        console = Console(file=io.StringIO(), force_terminal=terminal, width=80)
        with RunProgress(console, 20.0) as display:
            display.compiling(Compilation("hover", ("plant", "sensors"), 40.0))
            if display._bar:
                display._bar.refresh()
            output = console.file.getvalue()
            display.begin()
        assert expected in output


@pytest.mark.parametrize("terminal", [True, False])
def test_scenes_are_compiled_ahead_with_bar_or_line_each(setup, folder, monkeypatch, terminal):
    monkeypatch.setattr(precompile, "BlockDiagram", Compiling)
    console = Console(file=io.StringIO(), force_terminal=terminal, width=100, markup=False)
    compile_ahead({"one": setup, "two": setup}, console)
    output = console.file.getvalue()
    assert output.count("ready after") == 2
    assert ("of about 42 s  " in output) == terminal
    assert ("hover: compiling kernels of plant, autopilot, trajectory, about 21 s" in output) == (not terminal)


def test_broken_scene_of_folder_does_not_stop_others(tmp_path, monkeypatch):
    compiled = []
    monkeypatch.setattr("lapwing.runs.precompile.compile_ahead", lambda setups, console: compiled.extend(setups))
    for name in ("a", "c"):
        (tmp_path / f"{name}.toml").write_text("[run")
    (tmp_path / "b.toml").write_bytes(Path("lapwing/scenes/hover.toml").read_bytes())
    result = CliRunner().invoke(app, ["precompile", str(tmp_path)])
    assert (result.exit_code, compiled) == (2, [str(tmp_path / "b.toml")])
    assert [line.partition(": not valid TOML")[0] for line in result.output.splitlines()] == [
        f"lapwing: {tmp_path / name}.toml" for name in ("a", "c")
    ]
