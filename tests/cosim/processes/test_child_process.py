"""Child processes: early start before the run configuration is known, forks, and their ends."""

import os
import signal
import subprocess
import tempfile
import time
from pathlib import Path

import pytest

from lapwing.cosim.processes.child_process import Forked, start_early
from tests.commands import assert_rejected, run_command


def test_unused_early_child_is_terminated():
    with start_early(["mavlink", "recorder"]) as early:
        used, unused = early.pop("mavlink"), early["recorder"]
        assert used.process.poll() is None
    assert unused.process.poll() is not None
    assert unused.output.closed
    try:
        assert used.process.poll() is None
        used.process.stdin.close()
        assert used.process.wait(60.0) == 1  # it received no configuration
        used.output.seek(0)
        assert used.output.read() == b""
    finally:
        used.process.kill()
        used.process.wait()
        used.output.close()


def code_of(run):
    with tempfile.TemporaryFile() as output:
        child = Forked(run, output)
        code = child.wait(60.0)
        child.stdin.close()
        output.seek(0)
        return code, output.read().decode()


def test_fork_exits_like_separate_program():
    def leave(value):
        raise SystemExit(value)

    def fail():
        raise KeyError("rotor")

    def say():
        print("own session" if os.getsid(0) == os.getpid() else "session of its parent", flush=True)
        os.write(2, os.read(0, 1) + b"end of input")

    assert code_of(lambda: None) == (0, "")
    assert code_of(lambda: leave(2)) == (2, "")
    assert code_of(lambda: leave(None)) == (0, "")
    code, output = code_of(fail)
    assert code == 1
    assert "KeyError" in output
    with tempfile.TemporaryFile() as output:
        child = Forked(say, output)
        assert child.poll() is None
        child.stdin.close()
        assert child.wait(60.0) == child.poll() == child.returncode == 0
        output.seek(0)
        assert output.read() == b"own session\nend of input"


@pytest.mark.parametrize(("end", "number"), [("kill", signal.SIGKILL), ("send_signal", signal.SIGTERM)])
def test_fork_is_ended_by_signal_and_may_be_killed_twice(end, number):
    with tempfile.TemporaryFile() as output:
        child = Forked(lambda: time.sleep(60.0), output)
        child.stdin.close()
        with pytest.raises(subprocess.TimeoutExpired):
            child.wait(0.05)
        getattr(child, end)(*[number] * (end == "send_signal"))
        assert child.wait() == -number
        child.kill()


def test_fork_closes_files_of_other_forks():
    """A fork with another child's standard input open would prevent that child's end after the launcher's."""
    with tempfile.TemporaryFile() as first_output, tempfile.TemporaryFile() as second_output:
        first = Forked(lambda: os.read(0, 1), first_output)
        second = Forked(lambda: time.sleep(60.0), second_output)
        first.stdin.close()
        assert first.wait(60.0) == 0
        second.kill()
        second.wait()
        second.stdin.close()


@pytest.mark.parametrize(
    ("arguments", "word"), [(["nowhere.toml"], "nowhere.toml"), (["lapwing/scenes/hover.toml", "--mavlink", "x"], "x")]
)
def test_user_error_is_one_line_after_link_start(arguments, word):
    assert_rejected(
        run_command("run", *arguments, "--mavlink", "udpout:127.0.0.1:14550", folder=Path(__file__).parents[2]), word
    )
