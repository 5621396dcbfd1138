"""Files in memory, ten times as fast as files on a disk."""

import atexit
import os
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory


@cache
def _folder() -> Path:
    folder = TemporaryDirectory(prefix="fuzz-")
    atexit.register(folder.cleanup)
    return Path(folder.name)


@cache
def _file(name: str) -> tuple[int, Path]:
    descriptor, path = os.memfd_create(name), _folder() / name  # readers depend on the file name extension
    path.symlink_to(f"/proc/{os.getpid()}/fd/{descriptor}")
    return descriptor, path


def memory_file(data: bytes, name: str) -> Path:
    """Return the path of the file `name` with new contents."""
    descriptor, path = _file(name)
    os.ftruncate(descriptor, 0)
    os.pwrite(descriptor, data, 0)
    return path
