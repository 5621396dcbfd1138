"""Notice and bar of compilation: only when something compiles, without unfounded estimates."""

import io
import random
from pathlib import Path

import pytest
from rich.console import Console
from typer.testing import CliRunner

from lapwing.cli.main import app
from lapwing.cli.progress import RunProgress
from lapwing.kernels import kernel
from lapwing.runs import precompile
from lapwing.runs.observer import Compilation, notify_on_compile
from lapwing.runs.precompile import compile_ahead
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.workers import run_here

SERVICES = ("plant", "autopilot", "trajectory")  # of the hover scene


@pytest.fixture(scope="module")
def config():
    return resolve(load("hover"))


def compile_something():
    new = random.random()  # the cache has no kernel with this constant

    @kernel
    def times(x):
        return new * x

    assert times(1.0) == new
    assert times(2) == 2.0 * new


class Compiling:
    """Fake graph: compiles at construction and has a tick to run."""

    def __init__(self, *_):
        compile_something()

    def advance(self, _):
        pass


def test_compile_notice_appears_once_and_only_when_needed(config):
    output = []
    with notify_on_compile(config, output.append):
        pass
    assert output == []
    with notify_on_compile(config, output.append):
        compile_something()
    assert output == [Compilation("hover", SERVICES)]


def test_terminal_has_bar_and_other_streams_have_line():
    for terminal, expected in (
        (True, "   0 s  compiling hover, once"),
        (False, "hover: compiling kernels of plant, sensors (cached for later runs) ..."),
    ):
        console = Console(file=io.StringIO(), force_terminal=terminal, width=80)
        with RunProgress(console, 20.0) as display:
            display.compiling(Compilation("hover", ("plant", "sensors")))
            if display._bar:
                display._bar.refresh()
            output = console.file.getvalue()
            display.begin()
        assert expected in output


@pytest.mark.parametrize("terminal", [True, False])
def test_precompile_shows_bar_or_lines(config, monkeypatch, capsys, terminal):
    monkeypatch.setattr(precompile, "BlockDiagram", Compiling)
    console = Console(file=io.StringIO(), force_terminal=terminal, width=100, markup=False)
    compile_ahead({"one": config, "two": config}, console, run_here)
    output = console.file.getvalue()
    assert output.count("ready after") == 2
    assert ("kernels of 6 of 6 services  hover " in output) == terminal
    assert len(output.splitlines()) == 2 or terminal
    assert capsys.readouterr().err == ("" if terminal else "compiling or loading the kernels of 6 services ...\n")


def test_precompile_begins_with_plant_and_compiles_each_service_once(config, monkeypatch):
    tasks = []

    def workers(call, given):
        assert call is precompile.compile_service
        tasks.extend(name for _, name in given)
        return iter(())

    monkeypatch.setattr(precompile, "BlockDiagram", Compiling)
    compile_ahead({"one": config}, Console(file=io.StringIO()), workers)
    assert tasks[0] == "plant"
    assert sorted(tasks) == sorted(SERVICES)


def test_broken_scene_of_folder_does_not_stop_others(tmp_path, monkeypatch):
    compiled = []
    monkeypatch.setattr(
        "lapwing.runs.precompile.compile_ahead", lambda configs, console, workers: compiled.extend(configs)
    )
    for name in ("a", "c"):
        (tmp_path / f"{name}.toml").write_text("[run")
    (tmp_path / "b.toml").write_bytes(Path("lapwing/scenes/hover.toml").read_bytes())
    result = CliRunner().invoke(app, ["precompile", str(tmp_path)])
    assert (result.exit_code, compiled) == (2, [str(tmp_path / "b.toml")])
    assert [line.partition(": not valid TOML")[0] for line in result.output.splitlines()] == [
        f"lapwing: {tmp_path / name}.toml" for name in ("a", "c")
    ]
