"""File locks by which one process compiles a kernel while the others that need it wait and then load it.

A process that compiles a kernel holds a file lock, which the system releases when the process ends for any reason. The
holder waits only for locks of inner kernels, and no kernel calls itself. Therefore no deadlock can occur.
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
PATIENCE = 120.0  # [s] without work of the compiling process after which it is assumed to be suspended
LONGEST = 1200.0  # [s] to wait in all: of another container with this cache, the work is not known
LOOK = 0.02  # [s] between two attempts to take the lock


class Lock(NamedTuple):
    """The lock of one kernel."""

    path: Path
    descriptor: int


class _Held(threading.local):
    """The locks of this thread, in the order in which they were taken."""

    def __init__(self) -> None:
        self.locks: list[Lock] = []


_held = _Held()


def acquire(name: str) -> None:
    """Take the lock of the cache entry `name` and hold it to the end of `release_at_end`.

    Another process may have held it until now, so look up the cache entry again afterwards. No lock is taken if the
    file system has none, or if another process holds it for `PATIENCE` without using a processor: on a busy machine
    compiling takes long, and to compile twice makes it busier.
    """
    base = cache_files.root()
    if base is None:
        return
    path = base / FOLDER / hashlib.blake2b(name.encode(), digest_size=16).hexdigest()
    start, work = time.monotonic(), ""
    until = start + PATIENCE
    with contextlib.suppress(OSError):
        for folder in (base, path.parent):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        while time.monotonic() < until:
            try:
                _held.locks.append(Lock(path, _lock(path)))
                return
            except BlockingIOError:
                if (now := _work_of_holder(path)) != work:
                    work, until = now, min(time.monotonic() + PATIENCE, start + LONGEST)
                time.sleep(LOOK)


@contextlib.contextmanager
def release_at_end() -> Iterator[None]:
    """Release the locks that were taken within the context at its end."""
    before = len(_held.locks)
    try:
        yield
    finally:
        while len(_held.locks) > before:
            lock = _held.locks.pop()
            with contextlib.suppress(OSError):
                lock.path.unlink()
            os.close(lock.descriptor)


def _lock(path: Path) -> int:
    """Return the descriptor of a file that is now locked.

    Raises:
        BlockingIOError: another process holds the lock, or released it just now.
        OSError: the file cannot be written or locked.
    """
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if os.fstat(descriptor).st_nlink == 0:  # the previous holder removed the file; the next one creates a new one
            raise BlockingIOError
        os.ftruncate(descriptor, 0)  # a holder that was killed left its number
        os.write(descriptor, str(os.getpid()).encode())
    except OSError:
        os.close(descriptor)
        raise
    return descriptor


def _work_of_holder(path: Path) -> str:
    """Return the processor time that the process with a lock has used, as text; "" if it is not known."""
    try:
        status = Path(f"/proc/{int(path.read_text())}/stat").read_text()
    except (OSError, ValueError):
        return ""
    return " ".join(status.rpartition(")")[2].split()[11:13])  # in user and in system mode
