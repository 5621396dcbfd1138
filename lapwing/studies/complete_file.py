"""Atomic replacement of files: neither a reader nor an interrupted write leaves a partial file."""

import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def complete_file(path: Path) -> Iterator[Path]:
    """Yield a temporary path in the folder of `path`; its file replaces `path` at the end if no exception is raised."""
    new = path.with_name(f".{path.name}.{platform.node()}.{os.getpid()}")  # several machines may share the folder
    try:
        yield new
        os.replace(new, path)
    finally:
        new.unlink(missing_ok=True)
