"""Key spaces: the first part of every Zenoh key of a run, which keeps runs on one network apart."""

import fcntl
import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class SpaceInUse(ValueError):
    """Another run uses this key space."""


def check_space(space: str) -> None:
    """Refuse what cannot be the first part of a Zenoh key.

    Raises:
        ValueError: characters that a key cannot have, or an empty part.
    """
    if not re.fullmatch(r"[\w.-]+(/[\w.-]+)*", space, re.ASCII):
        raise ValueError(f"--space {space}: expected letters, digits, _, - and . (parts joined by /)")


@contextmanager
def key_space(space: str) -> Iterator[None]:
    """Hold a key space on this machine for the length of a run.

    Raises:
        SpaceInUse: another run holds it.
        ValueError: not a key space.
    """
    check_space(space)
    path = Path(tempfile.gettempdir()) / f"lapwing-{os.getuid()}-{space.replace('/', '_')}.lock"
    with path.open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise SpaceInUse(
                f"--space {space}: another run uses this key space; wait for its end or choose another name"
            ) from None
        yield
