"""The flight modes, a module each: `NAME`, and a class `Mode` that leads the guide.

`Mode(pilot, *values)` is made when the mode is entered, by the operator's values of the command of that name;
ValueError says why it cannot be. `step(pilot, dt)` leads the guide for one tick; `next` names the mode to go on with.
"""

import importlib
import pkgutil
from functools import cache
from types import ModuleType


@cache
def modes() -> dict[str, ModuleType]:
    """The modules of this folder by the names of their modes."""
    found = [importlib.import_module(f"{__name__}.{m.name}") for m in pkgutil.iter_modules(__path__)]
    return {module.NAME: module for module in found if hasattr(module, "NAME")}
