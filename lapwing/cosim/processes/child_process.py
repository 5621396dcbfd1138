"""Child processes of a launcher. A child may be started before its specification is known."""

import importlib
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import IO, NamedTuple

from lapwing.cosim.processes.forked_process import Forked

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
