"""The plots of the report: one file each, found by scanning this folder.

A plot file has `ORDER` (its place on the page), `TITLE`, `NEEDS` (the vehicle's topics that it cannot do without), and
`draw(flight)`, which returns a `lapwing.studies.report.plot.Plot`, or raises NotRecordedError with what is missing
in the log.
A plot that says something of certain models of vehicles only names them in `MODELS`;
one of all vehicles of a fleet has `FLEET = True`, and is left out where there is only one.
"""

from types import ModuleType

from lapwing.dynamics import discovery


def modules() -> list[ModuleType]:
    """Return all plot modules, in the order of the page."""
    return sorted(discovery.modules(__name__).values(), key=lambda module: module.ORDER)
