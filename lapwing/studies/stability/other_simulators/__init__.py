"""Other simulators on the cases that they can run: one file each, found by scanning this folder.

A file has `CASES`: by a case's name a function that gives, by the row's name, the figure of each method that it tries.
Where its package is not installed, importing it fails, and it is left out. Files that begin with _ have what several
share. Figures are of the case's own step, of simulators as they come but for what the case itself says, and decide
nothing: a case stands without them.
"""

from collections.abc import Mapping

from lapwing.dynamics import discovery

Figures = Mapping[str, Mapping[str, float]]  # by row, by method


def figures(case: str) -> dict[str, dict[str, float]]:
    """What the other simulators that are installed measure on a case: by row, by name of simulator and method."""
    found: dict[str, dict[str, float]] = {}
    for name in discovery.names(__name__):
        try:
            simulator = discovery.get(__name__, name, "simulator")
        except ImportError:
            continue
        if case in simulator.CASES:
            for row, measured in simulator.CASES[case]().items():
                found.setdefault(row, {}).update(measured)
    return found
