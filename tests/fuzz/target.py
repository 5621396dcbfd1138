"""Fuzz target: a reader of damaged bytes."""

from collections.abc import Callable
from typing import NamedTuple


class Target(NamedTuple):
    """Something that reads, and what it reads when all is well."""

    read: Callable[[bytes], object]
    seeds: tuple[bytes, ...]
