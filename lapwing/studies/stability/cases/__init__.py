"""The cases: one file each, found by scanning this folder.

A file has `HARD` (the difficulty), `run()` (returns the result) and `LONG = True` if it takes minutes.
A case whose difficulty can be walked has `sweep()` as well.
"""

from types import ModuleType

from lapwing.dynamics import discovery


def names() -> list[str]:
    """Return the names of all cases: their file names."""
    return discovery.names(__name__)


def get(name: str) -> ModuleType:
    """Return the module of a case.

    Raises:
        ValueError: there is none; the message lists the choices.
    """
    return discovery.get(__name__, name, "case")
