"""The user's own code, as a scene names it: "module", or "module:Name"."""

from collections.abc import Mapping
from types import ModuleType
from typing import Any

from cosim import user_module
from dynamics.errors import KeyedError


def parted(key: str, text: str) -> tuple[str, str]:
    """Module and name of "module:Name"; KeyedError where it is not of that form."""
    module, _, name = text.partition(":")
    if not module or not name.isidentifier():
        raise KeyedError(key, f"got {text!r}", 'a text of the form "module:Name"')
    return module, name


def loaded(key: str, module: str, texts: Mapping[str, str]) -> ModuleType:
    """A module that the set-up carries; KeyedError where it cannot be imported."""
    try:
        return user_module.load(module, texts)
    except SyntaxError as error:
        raise KeyedError(key, f"{module}.py, line {error.lineno}: {error.msg}") from error
    except Exception as error:
        raise KeyedError(key, f"{module}: {type(error).__name__}: {error}") from error


def named(key: str, text: str, texts: Mapping[str, str]) -> tuple[ModuleType, Any]:
    """The module of "module:Name", and what has that name in it.

    Raises:
        KeyedError: the module cannot be imported, or has no such name.
    """
    module, name = parted(key, text)
    found = loaded(key, module, texts)
    if not hasattr(found, name):
        own = [n for n, value in vars(found).items() if callable(value) and value.__module__ == found.__name__]
        raise KeyedError.unknown(key, f"name in {module}", name, own)
    return found, getattr(found, name)
