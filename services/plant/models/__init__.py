"""What a plant can be: one file for each value of `vehicle.model`, found by scanning this folder.

A model file has `check(scene)`, which refuses a scene that lacks what the model needs, and `create(scene)`, which gives
the lock-step service with `finished`. A table of its own is a `Section` in the same file. Where the plant is a system
of `lapwing.dynamics.integrators.RATES`, `system(scene)` gives its parameters and the state at the start.
"""

import importlib
import pkgutil
from functools import cache
from types import ModuleType

from lapwing.cosim.scene import Scene
from lapwing.dynamics.config_error import ConfigError
from lapwing.services.common.vehicle_schema import Vehicle


@cache
def names() -> tuple[str, ...]:
    """Every model's name: its file name."""
    return tuple(sorted(m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_")))


def get(name: str) -> ModuleType:
    """The module of a model; KeyedError that lists the choices if there is none."""
    if name not in names():
        raise ConfigError.unknown("vehicle.model", "model", name, names())
    return importlib.import_module(f"{__name__}.{name}")


def check(scene: Scene) -> None:
    """KeyedError if there is no such model, or the scene lacks what it needs or has what it cannot have."""
    get(scene[Vehicle].model).check(scene)
