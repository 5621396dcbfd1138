"""The systems of the accuracy study: one file each, found by scanning this folder.

A file has `problems()`, which gives its problems by the name that `lapwing accuracy` takes.
"""

from functools import cache

from lapwing.dynamics import discovery
from lapwing.studies.accuracy.problem import Problem


@cache
def problems() -> dict[str, Problem]:
    """Every problem by its name."""
    found: dict[str, Problem] = {}
    for module in discovery.modules(__name__).values():
        found |= module.problems()
    return found
