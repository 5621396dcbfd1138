"""Files that are replaced as a whole: a reader, or an interrupted write, never meets half a file."""

import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def complete_file(path: Path) -> Iterator[Path]:
    """Yield a temporary file beside `path`, which replaces it at the end if no exception is raised."""
    new = path.with_name(f".{path.name}.{platform.node()}.{os.getpid()}")  # several machines may share the folder
    try:
        yield new
        os.replace(new, path)
    finally:
        new.unlink(missing_ok=True)
