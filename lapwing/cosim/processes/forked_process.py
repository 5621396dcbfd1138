"""Forked child process: it keeps the modules that this process has imported."""

import os
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from typing import IO, NoReturn

from lapwing.cosim.processes.out_of_memory import prefer_as_victim

POLL = 0.005  # [s] between two checks whether it has exited


class Forked:
    """Child process with the subset of the interface of `subprocess.Popen` that a launcher uses.

    Attributes:
        pid: process id.
        stdin: write end of its standard input.
        returncode: exit code, or the negative number of the signal that ended it; None while it runs.
    """

    def __init__(self, run: Callable[[], None], output: IO[bytes]):
        """Start a child in a new session that calls `run` and writes its standard output and error to `output`."""
        mine, own = os.pipe()
        sys.stdout.flush()
        sys.stderr.flush()
        self.pid = os.fork()
        if self.pid == 0:
            _run(run, mine, output.fileno())
        os.close(mine)
        self.stdin: IO[bytes] | None = os.fdopen(own, "wb")
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """Return the exit code, None while it runs."""
        return self._look(os.WNOHANG)

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the exit and return the exit code.

        Raises:
            subprocess.TimeoutExpired: no exit within `timeout` seconds.
        """
        if timeout is None:
            code = self._look(0)
            assert code is not None
            return code
        deadline = time.monotonic() + timeout
        while (code := self.poll()) is None:
            if time.monotonic() > deadline:
                raise subprocess.TimeoutExpired("lapwing", timeout)
            time.sleep(POLL)
        return code

    def kill(self) -> None:
        """Send SIGKILL."""
        self.send_signal(signal.SIGKILL)

    def send_signal(self, number: int) -> None:
        """Send a signal, unless the child has exited."""
        if self.poll() is None:  # after its exit code is read, its id may belong to another process
            os.kill(self.pid, number)

    def _look(self, options: int) -> int | None:
        if self.returncode is None and (status := os.waitpid(self.pid, options))[0]:
            self.returncode = os.waitstatus_to_exitcode(status[1])
        return self.returncode


def _run(run: Callable[[], None], standard_input: int, output: int) -> NoReturn:
    """Run the child. It exits without the exit handlers that this process has registered."""
    code = 1
    try:
        os.setsid()
        prefer_as_victim()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        for here, there in ((standard_input, 0), (output, 1), (output, 2)):
            os.dup2(here, there)
        for file in map(int, os.listdir("/proc/self/fd")):  # including the standard input of earlier children
            if file > 2:
                with suppress(OSError):
                    os.close(file)
        sys.stdout, sys.stderr = (open(number, "w", buffering=1, closefd=False) for number in (1, 2))  # noqa: SIM115
        code = _code_of(run)
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        os._exit(code)


def _code_of(run: Callable[[], None]) -> int:
    """Return the exit code of a program that only calls `run`."""
    try:
        run()
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
        return 1
    return 0
