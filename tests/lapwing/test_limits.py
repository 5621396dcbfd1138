"""Limits of the environment and a killed process, through the real command: one line that names the cause.

`tests/faults/test_faults.py` limits the memory.
"""

import os
import signal
import stat
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from lapwing.cosim.log import LogReader
from tests.combinations import NIGHTLY, rest_nightly
from tests.commands import run_command
from tests.participants import participants

pytestmark = pytest.mark.long

HOVER = Path.cwd() / "lapwing/scenes/hover.toml"
SHORT = ["--set", "run.duration=0.2", "--set", "success.require=[]"]
UNSHARE = ["unshare", "--mount"]
PATIENCE = 300.0  # [s]


def shell(folder, script, *arguments):
    """Run a script, in which "$@" is the command with its arguments."""
    return run_command(*arguments, folder=folder, within=["sh", "-c", script, "sh"], PYTHONDONTWRITEBYTECODE="1")


def check_one_line(result, *messages, codes=(1, 2)):
    assert result.returncode in codes, (result.stdout, result.stderr)
    assert result.stderr.count("\n") == 1, result.stderr
    assert result.stderr.startswith("lapwing: ")
    assert any(message in result.stderr for message in messages), result.stderr


def permitted(command):
    with suppress(OSError):
        return subprocess.run(command, capture_output=True).returncode == 0
    return False


@pytest.mark.parametrize("files", rest_nightly(20, 12))
def test_run_reports_open_file_limit(tmp_path, files):
    result = shell(tmp_path, f'ulimit -n {files}; exec "$@"', "run", HOVER, *SHORT, "--log", "a.mcap")
    check_one_line(result, "too many open files")


@NIGHTLY
def test_run_reports_address_space_limit(tmp_path):
    result = shell(tmp_path, 'ulimit -v 900000; exec "$@"', "run", HOVER, *SHORT, "--log", "a.mcap")
    if result.returncode != 0 or result.stderr:  # it may be enough
        check_one_line(result, "not enough memory", "ended unexpectedly")


@pytest.mark.skipif(not permitted([*UNSHARE, "true"]), reason="needs the right to make mount namespaces")
@pytest.mark.parametrize("place", ["log", "folder"])
def test_read_only_mount_is_named(tmp_path, place):
    arguments = ["--log", "disk/a.mcap"] if place == "log" else []
    enter = "" if place == "log" else "cd disk;"
    mount = f'mount -t tmpfs -o ro,size=1M none "{tmp_path}/disk"'
    (tmp_path / "disk").mkdir()
    script = f'exec {" ".join(UNSHARE)} sh -c \'{mount}; {enter} exec "$@"\' sh "$@"'
    result = shell(tmp_path, script, "run", HOVER, *SHORT, *arguments)
    check_one_line(result, "cannot be written: read-only file system", codes=(2,))


@pytest.mark.parametrize(("umask", "mode"), rest_nightly(("027", 0o640), ("022", 0o644), ("077", 0o600)))
def test_files_follow_umask(tmp_path, umask, mode):
    words = ["--mode", "single-process", "--log", "a.mcap", "--json", "a.json"]
    result = shell(tmp_path, f'umask {umask}; exec "$@"', "run", HOVER, *SHORT, *words)
    assert result.returncode == 0, result.stderr
    modes = {path.name: stat.S_IMODE(path.stat().st_mode) for path in tmp_path.iterdir()}
    assert modes == dict.fromkeys(("a.mcap", "a.json", "a.html"), mode)


@contextmanager
def flight(tmp_path):
    """Yield a run at speed 1."""
    words = ["run", HOVER, "--speed", "1", "--set", "run.duration=60", "--log", tmp_path / "a.mcap"]
    command = [sys.executable, "-m", "lapwing", *map(str, words), "--key-prefix", "test-limits"]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, start_new_session=True) as process:
        try:
            yield process
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)


def await_flight(log, process):
    deadline = time.monotonic() + PATIENCE
    while process.poll() is None and time.monotonic() < deadline:
        with suppress(ValueError), LogReader(log) as read:
            if any(True for _ in read.messages(start_ns=1_000_000_000)):
                return
        time.sleep(0.1)
    raise AssertionError(process.communicate())


def test_killed_recorder_leaves_advice_to_recover(tmp_path):
    with flight(tmp_path) as process:
        await_flight(tmp_path / "a.mcap", process)
        os.kill(participants(process.pid)["recorder"], signal.SIGKILL)
        out, error = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert error.startswith("lapwing: recorder ended unexpectedly (signal 9)")
    assert error.count("\n") == 1
    advice = f"lapwing recover {tmp_path / 'a.mcap'}"
    assert f"`{advice}`" in out
    run_command(*advice.split()[1:], code=0)
    with LogReader(tmp_path / "a_recovered.mcap") as read:
        assert max(time_ns for *_, time_ns, _ in read.messages()) >= 1_000_000_000
