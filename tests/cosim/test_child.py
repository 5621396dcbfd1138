"""Processes that are started before it is known what they are given."""

import subprocess
import sys
from pathlib import Path

import pytest

from cosim.child import started_early


def test_one_that_nobody_needs_ends_with_the_context_and_one_that_is_taken_goes_on():
    with started_early("mavlink", "recorder") as early:
        taken, left = early.pop("mavlink"), early["recorder"]
        assert taken.process.poll() is None
    assert left.process.poll() is not None
    assert left.said.closed
    try:
        assert taken.process.poll() is None
        taken.process.stdin.close()
        assert taken.process.wait(60.0) == 1  # nobody will tell it what to do
        taken.said.seek(0)
        assert taken.said.read() == b""
    finally:
        taken.process.kill()
        taken.process.wait()
        taken.said.close()


@pytest.mark.parametrize(
    ("arguments", "word"), [(["nowhere.toml"], "nowhere.toml"), (["scenes/hover.toml", "--mavlink", "x"], "x")]
)
def test_an_error_of_the_user_is_one_line_also_where_a_link_has_been_started(arguments, word):
    command = [sys.executable, "-m", "lapwing", "run", *arguments, "--mavlink", "udpout:127.0.0.1:14550"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=Path(__file__).parents[2], timeout=120)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert word in done.stderr
