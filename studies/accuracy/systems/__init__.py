"""The systems of the accuracy study: one file each, found by scanning this folder.

A file has `problems()`, which gives its problems by the name that `lapwing accuracy` takes.
"""

import importlib
import pkgutil
from functools import cache

from studies.accuracy.problem import Problem


@cache
def problems() -> dict[str, Problem]:
    """Every problem by its name."""
    found: dict[str, Problem] = {}
    for module in pkgutil.iter_modules(__path__):
        found |= importlib.import_module(f"{__name__}.{module.name}").problems()
    return found
