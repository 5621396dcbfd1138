"""Key prefixes: the first part of every Zenoh key of a run, which keeps runs on one network apart."""

import re


def check_key_prefix(key_prefix: str) -> None:
    """Refuse what cannot be the first part of a Zenoh key.

    Raises:
        ValueError: characters that a key cannot have, or an empty part.
    """
    if not re.fullmatch(r"[\w.-]+(/[\w.-]+)*", key_prefix, re.ASCII):
        raise ValueError(f"--key-prefix {key_prefix}: expected letters, digits, _, - and . (parts joined by /)")
