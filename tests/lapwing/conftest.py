"""`lapwing` called as its command, in this process."""

import signal
import sys
from pathlib import Path

import pytest

from lapwing.cli import entry_point as cli

ROOT = Path.cwd()


@pytest.fixture
def lapwing(monkeypatch, tmp_path, capfd):
    """Calls `lapwing` in an empty folder with the scenes in it: exit code, standard output, standard error."""
    (tmp_path / "scenes").symlink_to(ROOT / "lapwing/scenes")
    monkeypatch.chdir(tmp_path)
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["lapwing", *map(str, arguments)])
        try:
            cli.main()
            code = 0
        except SystemExit as end:
            code = end.code
        output = capfd.readouterr()
        return code, output.out, output.err

    yield call
    for number, handler in handlers.items():
        signal.signal(number, handler)
