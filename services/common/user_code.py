"""The user's own code, as a scene names it: "module", or "module:Name"."""

import inspect
import re
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from lapwing.cosim.config import user_module
from lapwing.dynamics.config_error import ConfigError

MEMORY = "memory"  # the module in the name of an object that only this process has: "memory:MyController"
_lent: dict[str, Any] = {}  # such objects


@contextmanager
def lent(thing: Any, folder: Path) -> Iterator[str]:
    """The name by which a scene can call for a class, a function or an object, as long as the context lasts.

    What stands as it is in a module that a set-up can carry is named as in a scene's file, "module:Name"; anything
    else, "memory:Name", lives in this process only.

    Args:
        thing: what is to be named; a text is a name already.
        folder: of the scene.
    """
    if name := thing if isinstance(thing, str) else _carried(thing, folder):
        yield name
        return
    base = re.sub(r"\W", "", getattr(thing, "__name__", type(thing).__name__)) or "object"
    name, number = base, 1
    while name in _lent:
        number += 1
        name = f"{base}_{number}"
    _lent[name] = thing
    try:
        yield f"{MEMORY}:{name}"
    finally:
        del _lent[name]


def _carried(thing: Any, folder: Path) -> str:
    """The name of a class or function whose module, as it was imported, a set-up would carry; "" of anything else."""
    if not (inspect.isclass(thing) or inspect.isfunction(thing)) or thing.__module__ == "__main__":
        return ""
    module, name = sys.modules.get(thing.__module__), thing.__qualname__
    if module is None or getattr(module, name, None) is not thing:
        return ""
    try:
        file = user_module.find("", module.__name__, folder)[module.__name__]
    except ConfigError:
        return ""
    same = user_module.source(module) in (None, file.read_text(encoding="utf-8"))
    return f"{module.__name__}:{name}" if same else ""


def parted(key: str, text: str) -> tuple[str, str]:
    """Module and name of "module:Name"; KeyedError where it is not of that form."""
    module, _, name = text.partition(":")
    if not module or not name.isidentifier():
        raise ConfigError(key, f"got {text!r}", 'a text of the form "module:Name"')
    return module, name


def loaded(key: str, module: str, texts: Mapping[str, str]) -> ModuleType:
    """A module that the set-up carries; KeyedError where it cannot be imported."""
    try:
        return user_module.load(module, texts)
    except SyntaxError as error:
        raise ConfigError(key, f"{module}.py, line {error.lineno}: {error.msg}") from error
    except user_module.FAULTS as error:
        raise ConfigError(key, f"{module}: {type(error).__name__}: {error}") from error


def named(key: str, text: str, texts: Mapping[str, str]) -> tuple[ModuleType, Any]:
    """The module of "module:Name", and what has that name in it.

    Raises:
        KeyedError: the module cannot be imported, or has no such name; the object is not there any more.
    """
    module, name = parted(key, text)
    if module == MEMORY:
        if name not in _lent:
            message = f"{name} was an object in the memory of the Python session that flew it"
            raise ConfigError(key, message, "a class in a module, which a log carries")
        thing = _lent[name]
        return sys.modules[getattr(thing, "__module__", type(thing).__module__)], thing
    found = loaded(key, module, texts)
    if not hasattr(found, name):
        own = [n for n, value in vars(found).items() if callable(value) and value.__module__ == found.__name__]
        raise ConfigError.unknown(key, f"name in {module}", name, own)
    return found, getattr(found, name)
