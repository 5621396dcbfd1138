"""Plots of the report: one file for each, discovered in this folder.

A plot file has `ORDER` (its position on the page), `TITLE`, `NEEDS` (required topics of the vehicle), and
`draw(flight)`, which returns a `lapwing.views.report.plot.Plot`, or raises NotRecordedError with a text on the
missing data. A plot for certain vehicle models lists them in `MODELS`; a plot of all vehicles of a fleet has
`FLEET = True`, and is omitted for a single vehicle.
"""

from types import ModuleType

from lapwing.dynamics import discovery


def modules() -> list[ModuleType]:
    """Return all plot modules, in the order of the page."""
    return sorted(discovery.modules(__name__).values(), key=lambda module: module.ORDER)
