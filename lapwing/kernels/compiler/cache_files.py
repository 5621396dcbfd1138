"""Files of the cache: each has a checksum and is written atomically; no function here raises.

A file that is not in the cache may be in the package: `make wheel` builds a wheel that contains compiled kernels.

Several processes may read and write at the same time: a file is written under a unique name and then renamed.
"""

import contextlib
import hashlib
import os
import uuid
from functools import cache
from pathlib import Path

CHECKSUM = 32  # bytes, before the content
SHIPPED = Path(__file__).parents[1] / "shipped"  # contents of a wheel, laid out as in `root()`
KEPT = 4  # versions of one file, so that two checkouts do not delete each other's


@cache
def root() -> Path | None:
    """Return the folder of the cache, or None if there is none (no home folder)."""
    setting = os.environ.get("LAPWING_CACHE")
    try:
        return Path(setting) if setting else Path.home() / ".cache" / "lapwing"
    except RuntimeError:
        return None


def _checksum(content: bytes) -> bytes:
    return hashlib.blake2b(content, digest_size=CHECKSUM).digest()


def _ours(status: os.stat_result) -> bool:
    """Return True if only this user or root can have written a file, because its content is executed."""
    return status.st_uid in (0, os.geteuid()) and not status.st_mode & 0o022


def read(folder: str, name: str, version: str) -> bytes | None:
    """Return the content that `write` stored; None if it is missing, damaged, or writable for other users."""
    places = [base / folder / f"{name}-{version}" for base in (root(), SHIPPED) if base is not None]
    return next((content for place in places if (content := _content(place)) is not None), None)


def _content(path: Path) -> bytes | None:
    try:
        with path.open("rb") as file:
            if not _ours(os.fstat(file.fileno())):
                return None
            data = file.read()
    except OSError:
        return None
    content = data[CHECKSUM:]
    return content if data[:CHECKSUM] == _checksum(content) else None


def write(folder: str, name: str, version: str, content: bytes) -> None:
    """Store `content` and delete all but the newest versions of `name`; do nothing where the folder is not writable.

    Args:
        folder: relative to the root, such as "kernels/dynamics.cell".
        name: file name without the version.
        version: hexadecimal digits.
        content: bytes to store.
    """
    base = root()
    if base is None:
        return
    place = base / folder
    temporary = place / f"{name}-{version}.{uuid.uuid4().hex}"
    try:
        for path in (base, *reversed([base / p for p in Path(folder).parents if p.name]), place):
            path.mkdir(mode=0o700, parents=True, exist_ok=True)  # the content is executed
        with open(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
            file.write(_checksum(content) + content)
        temporary.replace(place / f"{name}-{version}")
        versions = sorted(place.glob(f"{name}-*"), key=lambda path: path.stat().st_mtime_ns)
    except OSError:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
        return
    for path in versions[:-KEPT]:
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)


def remove(folder: str, name: str) -> None:
    """Delete every version of every file whose name begins with `name-`."""
    base = root()
    with contextlib.suppress(OSError):
        for path in (base / folder).glob(f"{name}-*") if base else ():
            path.unlink(missing_ok=True)
