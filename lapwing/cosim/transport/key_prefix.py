"""Key prefix: the first part of every Zenoh key of a run, which separates runs on one network."""

import re


def check_key_prefix(key_prefix: str) -> None:
    """Raise ValueError if the text cannot be the first part of a Zenoh key."""
    if not re.fullmatch(r"[\w.-]+(/[\w.-]+)*", key_prefix, re.ASCII):
        raise ValueError(f"--key-prefix {key_prefix}: expected letters, digits, _, - and . (parts joined by /)")
