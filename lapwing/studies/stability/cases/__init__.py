"""The cases: one file each, found by scanning this folder.

A file has `HARD`, what is hard about it, `run()`, which gives what was found, and where it takes minutes `LONG = True`.
A case whose difficulty can be walked has `sweep()` as well.
"""

from types import ModuleType

from lapwing.dynamics import discovery


def names() -> list[str]:
    """Every case's name: its file name."""
    return discovery.names(__name__)


def get(name: str) -> ModuleType:
    """The module of a case.

    Raises:
        ValueError: there is none; the text lists the choices.
    """
    return discovery.get(__name__, name, "case")
