"""A process of a run as its launcher holds it. It may be started before it is known what it is given."""

import importlib
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import IO, NamedTuple

from lapwing.cosim.processes.forked_process import Forked

PARTICIPANT = "lapwing.services.process_main"  # the module that a child runs


class Child(NamedTuple):
    """A child of this process."""

    process: subprocess.Popen | Forked
    said: IO[bytes]  # all that it has written to its standard output and error


def start(name: str) -> Child:
    """Start a participant in a new interpreter; it waits for its specification on standard input."""
    said = tempfile.TemporaryFile()  # noqa: SIM115 (its owner closes it)
    # -P: nothing is imported from the working directory
    command = [sys.executable, "-P", "-m", PARTICIPANT, name]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=said, stderr=said, start_new_session=True)
    return Child(process, said)


def _may_fork() -> bool:
    """Whether a fork finds all as it is here: other systems' libraries may have threads before anything is flown."""
    from lapwing.cosim.transport.bus import in_use  # not before: a command that flies nothing has no need of Zenoh

    return sys.platform == "linux" and threading.active_count() == 1 and not in_use()


def _fork(name: str) -> Child:
    """The same, with all that this process has imported."""
    main = importlib.import_module(PARTICIPANT).main
    said = tempfile.TemporaryFile()  # noqa: SIM115 (its owner closes it)
    return Child(Forked(lambda: main(name), said), said)


@contextmanager
def started_early(names: Iterable[str]) -> Iterator[dict[str, Child]]:
    """Children by name, of which `launch` takes those that it needs and ends the others.

    Where that is possible they have what this process has imported.
    """
    begin = _fork if _may_fork() else start
    children = {name: begin(name) for name in names}
    try:
        yield children
    finally:
        dismiss(children)


def dismiss(children: dict[str, Child]) -> None:
    """End those that nobody needs."""
    for child in children.values():
        assert child.process.stdin is not None
        child.process.stdin.close()
        child.process.kill()
        child.process.wait()
        child.said.close()
    children.clear()
