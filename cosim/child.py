"""A process of a run as its launcher holds it. It may be started before it is known what it is given, to import
meanwhile what it will need."""

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO, NamedTuple

PARTICIPANT = "services.participant"  # the module that a child runs


class Child(NamedTuple):
    """A child of this process."""

    process: subprocess.Popen
    said: IO[bytes]  # all that it has written to its standard output and error


def start(name: str, inherited: tuple[int, ...] = (), said: IO[bytes] | None = None) -> Child:
    """A child that takes part as `name`, once that has been written to its standard input.

    Args:
        name: of the participant.
        inherited: open files that it is given.
        said: what a former process of this name has written, to be gone on with.
    """
    said = said or tempfile.TemporaryFile()  # noqa: SIM115 (its owner closes it)
    # -P: nothing is imported from the working directory
    command = [sys.executable, "-P", "-m", PARTICIPANT, name]
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=said, stderr=said, start_new_session=True, pass_fds=inherited
    )
    return Child(process, said)


@contextmanager
def started_early(*names: str) -> Iterator[dict[str, Child]]:
    """Children by name, of which `launch` takes those that it needs; the others end with the context."""
    children = {name: start(name) for name in names}
    try:
        yield children
    finally:
        for child in children.values():
            assert child.process.stdin is not None
            child.process.stdin.close()
            child.process.kill()
            child.process.wait()
            child.said.close()
