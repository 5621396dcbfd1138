"""Reading of regular input files."""

import errno
from pathlib import Path


def check_regular(path: Path) -> None:
    """Raise OSError for a pipe, a socket or a device, since reading it might never end."""
    if path.exists() and not path.is_file() and not path.is_dir():
        raise OSError(errno.EINVAL, "is not a regular file", str(path))


def unreadable(subject: str | Path, error: OSError | UnicodeDecodeError, expected: str) -> ValueError:
    """Return the error of an input file that cannot be read: its name or option, the reason, and the expected kind."""
    if isinstance(error, UnicodeDecodeError):
        reason = "not a UTF-8 text file"
    else:
        reason = (error.strerror or str(error)).lower()
    return ValueError(f"{subject}: cannot be read: {reason}; expected {expected}")


def read_bytes(path: Path) -> bytes:
    """Return the content of a regular file. Raise OSError if it cannot be read."""
    check_regular(path)
    return path.read_bytes()


def read_text(path: Path, encoding: str = "utf-8") -> str:
    """Return the text of a regular file. Raise OSError or UnicodeDecodeError if it cannot be read."""
    check_regular(path)
    return path.read_text(encoding=encoding)
