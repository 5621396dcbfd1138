"""A child that goes on with all that this process has imported, where a new interpreter would import it once more."""

import os
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from typing import IO, NoReturn

POLL = 0.005  # [s] between two looks at whether it has ended


class Forked:
    """What a launcher needs of `subprocess.Popen`, with the same names.

    Attributes:
        pid: its number.
        stdin: the other end of its standard input.
        returncode: exit code, or the number of the signal that has ended it, negative; None while it runs.
    """

    def __init__(self, run: Callable[[], None], said: IO[bytes]):
        """A child that runs `run`, in a session of its own, and writes to `said`."""
        mine, own = os.pipe()
        sys.stdout.flush()
        sys.stderr.flush()
        self.pid = os.fork()
        if self.pid == 0:
            _run(run, mine, said.fileno())
        os.close(mine)
        self.stdin: IO[bytes] | None = os.fdopen(own, "wb")
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """Its exit code, None while it runs."""
        return self._look(os.WNOHANG)

    def wait(self, timeout: float | None = None) -> int:
        """Its exit code, once it has ended.

        Raises:
            subprocess.TimeoutExpired: not within `timeout` seconds.
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

    def terminate(self) -> None:
        """Ask it to end."""
        self._send(signal.SIGTERM)

    def kill(self) -> None:
        """End it."""
        self._send(signal.SIGKILL)

    def _look(self, options: int) -> int | None:
        if self.returncode is None and (found := os.waitpid(self.pid, options))[0]:
            self.returncode = os.waitstatus_to_exitcode(found[1])
        return self.returncode

    def _send(self, number: int) -> None:
        if self.poll() is None:  # its number is another process's once it has been waited for
            os.kill(self.pid, number)


def _run(run: Callable[[], None], standard_input: int, said: int) -> NoReturn:
    """What the child does. It leaves without what this process has registered for its own end."""
    code = 1
    try:
        os.setsid()
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        for here, there in ((standard_input, 0), (said, 1), (said, 2)):
            os.dup2(here, there)
        for file in map(int, os.listdir("/proc/self/fd")):  # among them the standard input of those before it
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
    """The exit code that a program would have that does no more."""
    try:
        run()
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
        return 1
    return 0
