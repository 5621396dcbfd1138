"""Key spaces: the first part of every Zenoh key of a run, which keeps runs on one network apart."""

import fcntl
import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class KeyPrefixInUse(ValueError):
    """Another run uses this key prefix."""


def check_key_prefix(key_prefix: str) -> None:
    """Refuse what cannot be the first part of a Zenoh key.

    Raises:
        ValueError: characters that a key cannot have, or an empty part.
    """
    if not re.fullmatch(r"[\w.-]+(/[\w.-]+)*", key_prefix, re.ASCII):
        raise ValueError(f"--key-prefix {key_prefix}: expected letters, digits, _, - and . (parts joined by /)")


@contextmanager
def reserve(key_prefix: str) -> Iterator[None]:
    """Hold a key prefix on this machine for the length of a run.

    Raises:
        KeyPrefixInUse: another run holds it.
        ValueError: not a key prefix.
    """
    check_key_prefix(key_prefix)
    path = Path(tempfile.gettempdir()) / f"lapwing-{os.getuid()}-{key_prefix.replace('/', '_')}.lock"
    with path.open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise KeyPrefixInUse(
                f"--key-prefix {key_prefix}: another run uses this key prefix; wait for its end or choose another name"
            ) from None
        yield
