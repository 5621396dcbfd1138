"""User-private sockets of a run on one machine, and checks of files that are executed."""

import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

SCHEME = "unixsock-stream/"
LONGEST = 107  # [bytes] limit of a socket's path on Linux


@contextmanager
def private_endpoints(names: Iterable[str]) -> Iterator[dict[str, str]]:
    """Yield a Unix-domain socket for each name, in a new folder with mode 0700 and an unguessable name.

    Raises:
        ValueError: there is no folder for temporary files.
    """
    names = list(names)
    suffix_length = len("/lapwing-12345678/") + max(map(len, names))
    try:
        parent = tempfile.gettempdir()
        if len(parent.encode()) + suffix_length > LONGEST:
            parent = "/tmp"
        folder = tempfile.TemporaryDirectory(prefix="lapwing-", dir=parent, ignore_cleanup_errors=True)
    except OSError as error:
        raise ValueError(f"no folder for temporary files ({error.strerror}); set TMPDIR") from None
    with folder as path:
        yield {name: f"{SCHEME}{path}/{name}" for name in names}


def remove(endpoint: str) -> None:
    """Remove the folder of a private endpoint after its process has ended. Ignore other endpoints."""
    if endpoint.startswith(SCHEME):
        shutil.rmtree(Path(endpoint.removeprefix(SCHEME)).parent, ignore_errors=True)


def only_user_writable(path: Path) -> bool:
    """Return True if only this user or root can change a file, or the content of a folder.

    Raises:
        OSError: the file does not exist.
    """
    status = path.stat()
    return status.st_uid in (0, os.geteuid()) and not status.st_mode & 0o022
