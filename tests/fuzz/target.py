"""Fuzz target: a reader of damaged bytes."""

from collections.abc import Callable
from typing import NamedTuple


class Target(NamedTuple):
    """Reader and its valid inputs."""

    read: Callable[[bytes], object]
    seeds: tuple[bytes, ...]
