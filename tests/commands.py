"""The command `lapwing` as a process, as a user starts it."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]


def run_command(*words, code=None, folder=None, within=(), stdin=None, **environment):
    """Return the ended process of `lapwing WORDS` with its texts.

    `code`: exit code that it must have; `within`: program that starts it, such as a shell; `stdin`: text for it.
    """
    path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    values = os.environ | {"PYTHONPATH": path} | environment
    command = [*within, sys.executable, "-m", "lapwing", *map(str, words)]
    done = subprocess.run(command, cwd=folder, env=values, input=stdin, capture_output=True, text=True, timeout=1800.0)
    assert code in (None, done.returncode), done.stdout + done.stderr
    return done


def assert_rejected(done, *messages, code=2):
    """Check that a command ended with one line of error that contains the messages."""
    assert (done.returncode, done.stderr.count("\n")) == (code, 1), done.stdout + done.stderr
    assert done.stderr.startswith("lapwing: ")
    for message in messages:
        assert message in done.stderr
