"""Finds the modules of a folder by name: adding an effect, an integrator, a sensor or a plot is adding one file."""

import difflib
import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache
from types import ModuleType
from typing import TypeVar

T = TypeVar("T")


def names(package: ModuleType | str) -> list[str]:
    """Names of the modules of a package, sorted; those that begin with _ are left out. Imports none of them."""
    return list(_names(_dotted(package)))


def modules(package: ModuleType | str) -> dict[str, ModuleType]:
    """The modules of a package by name, sorted; those that begin with _ are left out. Imports all of them."""
    return {name: _module(_dotted(package), name) for name in names(package)}


def get(package: ModuleType | str, name: str, what: str) -> ModuleType:
    """One module of a package; imports no other.

    Args:
        package: the package, or its dotted name.
        name: of the module.
        what: what such a module is called in an error message, in the singular: "effect".

    Raises:
        ValueError: "unknown effect 'gravty'; did you mean gravity? (effects: ...)".
    """
    found = names(package)
    return _module(_dotted(package), choose(dict(zip(found, found, strict=True)), name, what))


def choose(choices: Mapping[str, T], name: str, what: str) -> T:
    """The entry of that name.

    Raises:
        ValueError: there is none; the message has the form that `get` gives.
    """
    if name in choices:
        return choices[name]
    near = difflib.get_close_matches(name, choices, n=1)
    hint = f"; did you mean {near[0]}?" if near else ""
    raise ValueError(f"unknown {what} {name!r}{hint} ({what}s: {', '.join(choices)})")


def _dotted(package: ModuleType | str) -> str:
    return package if isinstance(package, str) else package.__name__


@cache
def _names(package: str) -> tuple[str, ...]:
    paths = importlib.import_module(package).__path__
    return tuple(sorted(m.name for m in pkgutil.iter_modules(paths) if not m.name.startswith("_")))


@cache
def _module(package: str, name: str) -> ModuleType:
    return importlib.import_module(f"{package}.{name}")
