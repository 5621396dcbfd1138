"""Discovery of the modules of a folder: to add an effect, an integrator, a sensor or a plot, add one file."""

import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache
from types import ModuleType
from typing import TypeVar

from lapwing.dynamics.config_error import did_you_mean

T = TypeVar("T")


def names(package: ModuleType | str) -> list[str]:
    """Return the sorted names of a package's modules without a leading _, without importing them."""
    return list(_names(_package_name(package)))


def modules(package: ModuleType | str) -> dict[str, ModuleType]:
    """Import a package's modules without a leading _. Return them by name, sorted."""
    return {name: _module(_package_name(package), name) for name in names(package)}


def get(package: ModuleType | str, name: str, what: str) -> ModuleType:
    """Import and return one module of a package.

    Args:
        package: the package, or its dotted name.
        name: name of the module.
        what: kind of the module in error messages, in the singular: "effect".

    Raises:
        ValueError: "unknown effect 'gravty'; did you mean gravity? (effects: ...)".
    """
    result = names(package)
    return _module(_package_name(package), choose(dict(zip(result, result, strict=True)), name, what))


def choose(choices: Mapping[str, T], name: str, what: str) -> T:
    """Return the entry of a name.

    Raises:
        ValueError: it does not exist; the message has the form of `get`.
    """
    if name in choices:
        return choices[name]
    raise ValueError(f"unknown {what} {name!r}{did_you_mean(name, choices)} ({what}s: {', '.join(choices)})")


def _package_name(package: ModuleType | str) -> str:
    return package if isinstance(package, str) else package.__name__


@cache
def _names(package: str) -> tuple[str, ...]:
    paths = importlib.import_module(package).__path__
    return tuple(sorted(m.name for m in pkgutil.iter_modules(paths) if not m.name.startswith("_")))


@cache
def _module(package: str, name: str) -> ModuleType:
    return importlib.import_module(f"{package}.{name}")
