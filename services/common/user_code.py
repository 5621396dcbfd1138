"""User code that a scene names: "module" or "module:Name"."""

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

MEMORY = "memory"  # module name of objects in this process only: "memory:MyController"
_registered: dict[str, Any] = {}  # registered objects by name


@contextmanager
def register(thing: Any, folder: Path) -> Iterator[str]:
    """Register a class, function or object under a name for scenes, within the context.

    A definition in a module that the run configuration can store is named "module:Name". Anything else is named
    "memory:Name" and exists in this process only.

    Args:
        thing: object to name; a text is already a name.
        folder: folder of the scene.
    """
    if name := thing if isinstance(thing, str) else _module_of_log(thing, folder):
        yield name
        return
    base = re.sub(r"\W", "", getattr(thing, "__name__", type(thing).__name__)) or "object"
    name, number = base, 1
    while name in _registered:
        number += 1
        name = f"{base}_{number}"
    _registered[name] = thing
    try:
        yield f"{MEMORY}:{name}"
    finally:
        del _registered[name]


def _module_of_log(thing: Any, folder: Path) -> str:
    """Return "module:Name" of a class or function whose unchanged module can be stored. Return "" otherwise."""
    if not (inspect.isclass(thing) or inspect.isfunction(thing)) or thing.__module__ == "__main__":
        return ""
    module, name = sys.modules.get(thing.__module__), thing.__qualname__
    if module is None or getattr(module, name, None) is not thing:
        return ""
    try:
        file = user_module.find("", module.__name__, folder)[module.__name__]
    except ConfigError:
        return ""
    is_unchanged = user_module.source(module) in (None, file.read_text(encoding="utf-8"))
    return f"{module.__name__}:{name}" if is_unchanged else ""


def split_reference(key: str, text: str) -> tuple[str, str]:
    """Return module and name of "module:Name". Raise ConfigError for another form."""
    module, _, name = text.partition(":")
    if not module or not name.isidentifier():
        raise ConfigError(key, f"got {text!r}", '"module:Name"')
    return module, name


def load_module(key: str, module: str, texts: Mapping[str, str]) -> ModuleType:
    """Return a module that the run configuration stores. Raise ConfigError if it cannot be imported."""
    try:
        return user_module.load(module, texts)
    except SyntaxError as error:
        raise ConfigError(key, f"{module}.py, line {error.lineno}: {error.msg}") from error
    except user_module.FAULTS as error:
        raise ConfigError(key, f"{module}: {type(error).__name__}: {error}") from error


def load_object(key: str, text: str, texts: Mapping[str, str]) -> tuple[ModuleType, Any]:
    """Return the module of "module:Name" and the object of that name.

    Raises:
        ConfigError: the module cannot be imported or lacks the name, or the object is not registered.
    """
    module, name = split_reference(key, text)
    if module == MEMORY:
        if name not in _registered:
            message = f"{name} was an object in the memory of the Python session that ran it"
            raise ConfigError(key, message, "a class in a module, which the log stores")
        thing = _registered[name]
        return sys.modules[getattr(thing, "__module__", type(thing).__module__)], thing
    code = load_module(key, module, texts)
    if not hasattr(code, name):
        candidates = [n for n, value in vars(code).items() if callable(value) and value.__module__ == code.__name__]
        raise ConfigError.unknown(key, f"name in {module}", name, candidates)
    return code, getattr(code, name)
