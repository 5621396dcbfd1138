"""Systems of the accuracy study: one file for each, discovered in this folder.

A file defines `problems()`, which returns its problems by their names in `lapwing accuracy`.
"""

from functools import cache

from lapwing.dynamics import discovery
from lapwing.studies.accuracy.problem import Problem


@cache
def problems() -> dict[str, Problem]:
    """Return all problems by name."""
    result: dict[str, Problem] = {}
    for module in discovery.modules(__name__).values():
        result |= module.problems()
    return result
