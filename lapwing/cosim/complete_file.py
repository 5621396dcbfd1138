"""Atomic replacement of files: neither a reader nor an interrupted write leaves a partial file."""

import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lapwing.cosim.output_lock import write_errors


@contextmanager
def complete_file(path: Path) -> Iterator[Path]:
    """Yield a temporary path in the folder of `path`; its file replaces `path` at the end if no exception is raised.

    Raises:
        OSError: the file cannot be written; it names `path`.
    """
    new = path.with_name(f".{path.name}.{platform.node()}.{os.getpid()}")  # several machines may share the folder
    try:
        yield new
        os.replace(new, path)
    except OSError as error:
        if error.filename in (None, str(new)):
            error.filename, error.filename2 = str(path), None
        raise
    finally:
        new.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8; it replaces `path` when it is complete. Raise ValueError if it cannot be written."""
    with write_errors(path), complete_file(path) as file:
        file.write_text(text, encoding="utf-8")
