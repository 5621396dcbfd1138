"""The effects that a scene may call for: one file each, found by scanning this folder.

The file `body_drag.py` is the effect `body_drag`; it has a parameter NamedTuple `BodyDrag` and registers hooks for it
(see `_hooks`). Its parameters are the keys of the scene's table, checked against the annotations, unless the class has
`from_scene(table, airframe)`. A module constant `KIND` names what only one active effect may be.
"""

import importlib
import pkgutil
from collections.abc import Mapping
from types import ModuleType

from dynamics.effects._scene import checked
from dynamics.vehicles.airframe import Airframe

__all__ = ["checked", "from_scene", "get", "names", "parameter_class"]


def names() -> list[str]:
    """Every effect's name: its file name."""
    return sorted(m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_"))


def get(name: str) -> ModuleType:
    """The module of an effect; ValueError that lists the choices if there is none."""
    if name not in names():
        raise ValueError(f"unknown effect {name!r}: choose from {', '.join(names())}")
    return importlib.import_module(f"{__name__}.{name}")


def parameter_class(name: str) -> type:
    """The parameter NamedTuple of an effect: `BodyDrag` for `body_drag`."""
    return getattr(get(name), "".join(word.capitalize() for word in name.split("_")))


def from_scene(tables: Mapping[str, Mapping], airframe: Airframe) -> tuple:
    """The active effects of a scene, sorted by name, from the table of each.

    Raises:
        ValueError: one line `effects.<name>.<key>: ...` for an unknown effect, a parameter that is missing, unknown,
            of the wrong type or out of range, an effect that the vehicle cannot have, or two that exclude each other.
    """
    active = []
    kinds: dict[str, str] = {}
    for name in sorted(tables):
        kind = getattr(get(name), "KIND", name)
        if kind in kinds:
            raise ValueError(f"effects.{name}: excludes effects.{kinds[kind]}, both are a {kind}: keep one of them")
        kinds[kind] = name
        cls = parameter_class(name)
        build = getattr(cls, "from_scene", None)
        try:
            active.append(build(dict(tables[name]), airframe) if build else checked(cls, tables[name]))
        except ValueError as error:
            raise ValueError(f"effects.{name}{error}") from None
    return tuple(active)
