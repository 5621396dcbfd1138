"""Commands without the packages of the extras: they fly, or name the command that installs what they need."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from lapwing.cosim.optional_packages import EXTRAS

WITHOUT = """
import sys
sys.modules.update(dict.fromkeys(sys.argv[1].split(",")))
sys.argv = ["lapwing", *sys.argv[2:]]
from lapwing.cli.entry_point import main
main()
"""


def without_extras(tmp_path, *arguments):
    """Run `lapwing` in an interpreter in which the packages of all extras are missing."""
    command = [sys.executable, "-P", "-c", WITHOUT, ",".join(EXTRAS), *arguments]
    return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)


def test_packages_are_in_their_extra_only():
    project = tomllib.loads(Path("pyproject.toml").read_text())["project"]
    names = {
        extra: {re.split(r"[>=<\[; ]", text)[0] for text in texts}
        for extra, texts in project["optional-dependencies"].items()
    }
    assert all(package in names[extra] for package, extra in EXTRAS.items())
    assert not EXTRAS.keys() & {re.split(r"[>=<\[; ]", text)[0] for text in project["dependencies"]}
    assert set(EXTRAS.values()) <= {"report", "mavlink", "flights", "tune"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "hover", "--report", "r.html"], "--report jinja2 is not installed; pip install lapwing[report]"),
        (["run", "hover", "--report", "r.pdf"], "--report matplotlib is not installed; pip install lapwing[report]"),
        (["run", "hover", "--mavlink", "udp:localhost:1"], "pymavlink is not installed; pip install lapwing[mavlink]"),
        (["tune", "hover"], "control is not installed; pip install lapwing[tune]"),
        (["import", "f.ulg", "--out", "o.mcap"], "pyulog is not installed; pip install lapwing[flights]"),
    ],
)
def test_command_names_missing_extra(tmp_path, arguments, message):
    (tmp_path / "f.ulg").write_bytes(b"ULog\x01\x12\x35\x01" + bytes(8))
    result = without_extras(tmp_path, *arguments)
    assert (result.returncode, result.stderr) == (2, f"lapwing: {message}\n")
    assert [path.name for path in tmp_path.iterdir()] == ["f.ulg"]


@pytest.mark.long
def test_flight_without_extras(tmp_path):
    options = ["--mode", "single-process", "--set", "run.duration=0.1", "--log", "f.mcap"]
    result = without_extras(tmp_path, "run", "hover", *options)
    assert result.returncode == 0, result.stderr
    assert "report  none: jinja2 is not installed; pip install lapwing[report]" in result.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["f.mcap"]
