"""Fixture that calls the command `lapwing` in this process."""

import signal
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from lapwing.cli import entry_point as cli
from lapwing.cosim.processes import interrupt

ROOT = Path.cwd()


class Ended(NamedTuple):
    """Exit code and texts of a command, named as those of a process."""

    returncode: int
    stdout: str
    stderr: str


@pytest.fixture
def lapwing(monkeypatch, tmp_path, capfd):
    """Return a function that calls `lapwing` in a folder with only the scenes: exit code, output, errors."""
    (tmp_path / "scenes").symlink_to(ROOT / "lapwing/scenes")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(interrupt, "_raised", None)  # set again at the end: a signal of this test is that of no other
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["lapwing", *map(str, arguments)])
        try:
            cli.main()
            code = 0
        except SystemExit as end:
            code = end.code
        output = capfd.readouterr()
        return Ended(code, output.out, output.err)

    yield call
    for number, handler in handlers.items():
        signal.signal(number, handler)
