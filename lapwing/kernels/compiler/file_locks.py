"""One process compiles a kernel, and the others that need it at the same time wait, and load it.

Whoever compiles a kernel holds the lock of a file, which the system frees when the process ends, however it ends. While
it is held, locks of inner kernels only are waited for, and no kernel calls itself: nobody waits in a circle.
"""

import contextlib
import fcntl
import hashlib
import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from lapwing.kernels.compiler import cache_files

FOLDER = "compiling"
PATIENCE = 120.0  # [s] after which a process is taken to be stopped, and not to be compiling
LOOK = 0.02  # [s] between two looks at whether it has ended


class Lock(NamedTuple):
    """The lock of one kernel."""

    path: Path
    descriptor: int


class _Held(threading.local):
    """The locks of this thread, the first one first."""

    def __init__(self) -> None:
        self.locks: list[Lock] = []


_held = _Held()


def acquire(name: str) -> None:
    """Take the lock of what is kept in the cache under `name`, and hold it to the end of `released_at_end`.

    Somebody else may have had it until now: what is kept is worth another look. Where there are no locks, or somebody
    has it for too long, none is taken.
    """
    base = cache_files.root()
    if base is None:
        return
    path = base / FOLDER / hashlib.blake2b(name.encode(), digest_size=16).hexdigest()
    until = time.monotonic() + PATIENCE
    with contextlib.suppress(OSError):
        for folder in (base, path.parent):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        while time.monotonic() < until:
            try:
                _held.locks.append(Lock(path, _locked(path)))
                return
            except BlockingIOError:
                time.sleep(LOOK)


@contextlib.contextmanager
def released_at_end() -> Iterator[None]:
    """Locks that are taken within the context are released at its end."""
    before = len(_held.locks)
    try:
        yield
    finally:
        while len(_held.locks) > before:
            lock = _held.locks.pop()
            with contextlib.suppress(OSError):
                lock.path.unlink()
            os.close(lock.descriptor)


def _locked(path: Path) -> int:
    """The descriptor of a file, locked.

    Raises:
        BlockingIOError: somebody else has it, or had it until now.
        OSError: it cannot be written or locked.
    """
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if os.fstat(descriptor).st_nlink == 0:  # whoever had it has removed it, and the next one makes another
            raise BlockingIOError
    except OSError:
        os.close(descriptor)
        raise
    return descriptor
