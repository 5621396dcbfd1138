"""Cases of the stability study: one file for each, discovered in this folder.

A file defines `HARD` (the difficulty) and `run()`, which returns the result, and `LONG = True` if it takes minutes.
A case whose difficulty can be varied also defines `sweep()`.
"""

from types import ModuleType

from lapwing.dynamics import discovery


def names() -> list[str]:
    """Return the names of all cases: their file names."""
    return discovery.names(__name__)


def get(name: str) -> ModuleType:
    """Return the module of a case.

    Raises:
        ValueError: the case is unknown; the message lists the choices.
    """
    return discovery.get(__name__, name, "case")
