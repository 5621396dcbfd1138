"""Reading of regular input files."""

import errno
from pathlib import Path


def check_regular(path: Path) -> None:
    """Raise OSError for a pipe, a socket or a device, since reading it might never end."""
    if path.exists() and not path.is_file() and not path.is_dir():
        raise OSError(errno.EINVAL, "is not a regular file", str(path))


def read_bytes(path: Path) -> bytes:
    """Return the content of a regular file. Raise OSError if it cannot be read."""
    check_regular(path)
    return path.read_bytes()


def read_text(path: Path, encoding: str = "utf-8") -> str:
    """Return the text of a regular file. Raise OSError or UnicodeDecodeError if it cannot be read."""
    check_regular(path)
    return path.read_text(encoding=encoding)
