"""Compiling is told with a guess and a bar, and only where something compiles."""

import io
import json
import random
from pathlib import Path

import pytest
from rich.console import Console
from typer.testing import CliRunner

from lapwing.cli.main import app
from lapwing.cli.progress import Display
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


def test_it_is_said_once_and_only_where_something_compiles(setup, folder):
    said = []
    with notify_on_compile(setup, said.append):
        pass
    assert said == []
    assert not (folder / FILE).exists()
    with notify_on_compile(setup, said.append):
        compile_something()
    assert said == [Compilation("hover", SERVICES, EACH * len(SERVICES))]


def test_the_guess_is_the_time_that_it_took_before(setup, folder):
    with notify_on_compile(setup, lambda _: None):
        compile_something()
    (key,) = known = json.loads((folder / FILE).read_text())
    assert 0.0 <= known[key] < EACH
    (folder / FILE).write_text(json.dumps({key: 81.5}))
    said = []
    with notify_on_compile(setup, said.append):
        compile_something()
    assert [what.seconds for what in said] == [81.5]
    assert json.loads((folder / FILE).read_text()) == {key: 81.5}


@pytest.mark.parametrize("content", ["", "[]", '{"a": []}'])
def test_a_damaged_memory_is_none(setup, folder, content):
    (folder / FILE).write_text(content)
    said = []
    with notify_on_compile(setup, said.append):
        compile_something()
    assert said == [Compilation("hover", SERVICES, EACH * len(SERVICES))]


def test_a_terminal_has_a_bar_and_anything_else_a_line():
    for terminal, expected in (
        (True, "of about 40 s"),
        (False, "hover: compiling kernels of plant, sensors, about 40 s"),
    ):
        console = Console(file=io.StringIO(), force_terminal=terminal, width=80)
        with Display(console, 20.0) as display:
            display.compiling(Compilation("hover", ("plant", "sensors"), 40.0))
            if display._bar:
                display._bar.refresh()
            said = console.file.getvalue()
            display.begin()
        assert expected in said


@pytest.mark.parametrize("terminal", [True, False])
def test_scenes_are_compiled_ahead_with_a_bar_or_a_line_each(setup, folder, monkeypatch, terminal):
    monkeypatch.setattr(precompile, "BlockDiagram", Compiling)
    console = Console(file=io.StringIO(), force_terminal=terminal, width=100, markup=False)
    compile_ahead({"one": setup, "two": setup}, console)
    said = console.file.getvalue()
    assert said.count("ready after") == 2
    assert ("of about 30 s  " in said) == terminal
    assert ("hover: compiling kernels of plant, autopilot, trajectory, about 15 s" in said) == (not terminal)


def test_one_broken_scene_of_a_folder_stops_no_other(tmp_path, monkeypatch):
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
