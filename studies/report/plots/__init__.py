"""The plots of the report: one file each, found by scanning this folder.

A plot file has `ORDER` (its place on the page), `TITLE`, `NEEDS` (the vehicle's topics that it cannot do without), and
`draw(flown)`, which returns the figure and its caption, or raises NotRecordedError with what is missing in the log.
A plot that says something of certain models of vehicles only names them in `MODELS`.
"""

import importlib
import pkgutil
from types import ModuleType


def modules() -> list[ModuleType]:
    """Every plot's module, in order of the page."""
    found = (importlib.import_module(f"{__name__}.{m.name}") for m in pkgutil.iter_modules(__path__))
    return sorted(found, key=lambda module: module.ORDER)
