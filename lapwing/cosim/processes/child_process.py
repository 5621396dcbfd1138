"""Child processes of a launcher, started with a command or forked from this process.

A fork keeps the modules that this process has imported. A child may be started before its specification is known.
"""

import importlib
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, NamedTuple, NoReturn

BEFORE_LAUNCHER = 500  # added to a child's badness (thousandths of the memory): the launcher survives and names it
COUNTERS = Path("/proc/vmstat")


def prefer_as_victim() -> None:
    """Make the kernel kill this process before its parent process. Other systems ignore the call."""
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(str(BEFORE_LAUNCHER))


def kills() -> int:
    """Return the number of processes killed for lack of memory since the system started; 0 where it is unknown."""
    with suppress(OSError, ValueError):
        for line in COUNTERS.read_text().splitlines():
            name, _, count = line.partition(" ")
            if name == "oom_kill":
                return int(count)
    return 0


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
        signal.set_wakeup_fd(-1)
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


PARTICIPANT = "lapwing.services.process_main"  # module that a child runs
ChildProcess = subprocess.Popen | Forked


class Child(NamedTuple):
    """A child of this process."""

    process: ChildProcess
    output: IO[bytes]  # its standard output and error

    def text(self) -> str:
        """Return all output so far."""
        self.output.seek(0)
        return self.output.read().decode(errors="replace").strip()

    def last_line(self) -> str:
        """Return ": " and the last line of the output, "" if there is none."""
        lines = self.text().splitlines()
        return f": {lines[-1].removeprefix('lapwing: ')}" if lines else ""


def start(name: str) -> Child:
    """Start the participant `name` in a new interpreter; it waits for its specification on standard input."""
    output = tempfile.TemporaryFile()  # noqa: SIM115 (its owner closes it)
    # -P: nothing is imported from the working directory
    command = [sys.executable, "-P", "-m", PARTICIPANT, name]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=output, stderr=output, start_new_session=True)
    return Child(process, output)


def _may_fork() -> bool:
    """Return True if a fork inherits a consistent state: no other threads, and no Zenoh session so far."""
    from lapwing.cosim.transport.bus import in_use  # imported late: a command without a flight does not load Zenoh

    return sys.platform == "linux" and threading.active_count() == 1 and not in_use()


def _fork(name: str) -> Child:
    """Start the participant `name` as a fork, with the modules that this process has imported."""
    main = importlib.import_module(PARTICIPANT).main
    output = tempfile.TemporaryFile()  # noqa: SIM115 (its owner closes it)
    return Child(Forked(lambda: main(name), output), output)


@contextmanager
def start_early(names: Iterable[str]) -> Iterator[dict[str, Child]]:
    """Start participants for `launch`, forked if possible. At the end, kill those that it did not use."""
    begin = _fork if _may_fork() else start
    children = {name: begin(name) for name in names}
    try:
        yield children
    finally:
        terminate_unused(children)


def terminate_unused(children: dict[str, Child]) -> None:
    """Kill children that were started early and are not needed."""
    for child in children.values():
        assert child.process.stdin is not None
        child.process.stdin.close()
        child.process.kill()
        child.process.wait()
        child.output.close()
    children.clear()
