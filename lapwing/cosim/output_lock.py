"""Output files: errors of writing, and advisory locks (flock) that keep two processes from writing the same file."""

import fcntl
import os
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager
from errno import EWOULDBLOCK
from io import FileIO
from pathlib import Path

ATTEMPTS, PAUSE = 10, 0.02  # [s] `is_locked` of another process holds the lock for a moment


@contextmanager
def write_errors(path: str | Path) -> Iterator[None]:
    """Raise ValueError that names the path for an OSError within the context."""
    try:
        yield
    except OSError as error:
        folder = Path(path).parent
        known = (error.strerror or str(error)).lower()
        reason = known if folder.exists() else f"there is no folder {folder}; create it"
        raise ValueError(f"{path}: cannot be written: {reason}") from None


def modification_time(path: Path) -> int:
    """Return the time of the last write [ns], or 0 if the file does not exist."""
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0


class OutputLock:
    """Lock of a file or folder until `close`, or until the process ends.

    Args:
        path: existing file or folder.
        shared: allow other shared locks on it.

    Raises:
        ValueError: another process holds a lock on it.
        OSError: it cannot be opened for writing.
    """

    def __init__(self, path: Path, shared: bool = False) -> None:
        self.path = path
        flags = os.O_RDONLY if path.is_dir() else os.O_WRONLY | os.O_NONBLOCK
        self._descriptor = os.open(path, flags)
        try:
            lock_descriptor(self._descriptor, path, shared)
        except ValueError:
            self.close()
            raise

    def close(self) -> None:
        """Release the lock."""
        os.close(self._descriptor)


def lock_descriptor(descriptor: int, path: Path, shared: bool = False) -> None:
    """Lock an open file or folder until it is closed; do nothing for devices and on file systems without locks.

    Raises:
        ValueError: another process holds a lock on it.
    """
    mode = os.fstat(descriptor).st_mode
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        return
    for _ in range(ATTEMPTS):
        try:
            fcntl.flock(descriptor, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
            return
        except OSError as error:
            if error.errno != EWOULDBLOCK:
                return
        time.sleep(PAUSE)
    raise ValueError(f"{path}: another process is writing it; choose another name, or wait for it")


def is_locked(path: Path) -> bool:
    """Return True if another process is writing the file. Calls at the same time do not disturb each other."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError as error:
        return error.errno == EWOULDBLOCK
    finally:
        os.close(descriptor)
    return False


def open_locked(path: Path) -> FileIO:
    """Create or empty a file and open it for writing, locked and without a buffer.

    Raises:
        ValueError: another process is writing it.
        OSError: it cannot be written.
    """
    file = open(path, "r+b", buffering=0, opener=_open_or_create)  # noqa: SIM115 (returned)
    try:
        lock_descriptor(file.fileno(), path)
        if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            file.truncate()
    except BaseException:
        file.close()
        raise
    return file


def _open_or_create(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_CREAT, 0o666)
