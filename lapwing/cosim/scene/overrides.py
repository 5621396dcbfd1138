"""Overrides: new values for keys of a scene, from `--set KEY=VALUE` or from a mapping."""

import copy
import re
import tomllib
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from lapwing.cosim.scene.scene_error import KeyOrigin, SceneError

Overrides = Iterable[str] | Mapping[str, Any]
"""KEY=VALUE with a TOML value each (a bare word counts as a text), or values by dotted key."""


class Override(NamedTuple):
    """A key of a scene and its new value: KEY=VALUE."""

    key: str
    value: Any
    text: str  # text of the user


def parse_all(overrides: Overrides) -> list[Override]:
    """Parse the overrides. Raise SceneError for one that is not KEY=VALUE."""
    if isinstance(overrides, str):
        raise SceneError("", f"got {overrides!r}", 'overrides as a dictionary or a list: ["KEY=VALUE"]')
    if isinstance(overrides, Mapping):
        if invalid := [key for key in overrides if not isinstance(key, str)]:
            raise SceneError("", f"got {invalid[0]!r}", "the keys of overrides as texts")
        return [Override(key, _plain(value), f"{key}={value!r}") for key, value in overrides.items()]
    return [_parse(text) for text in overrides]


def _parse(text: str) -> Override:
    key, equals, value = (part.strip() for part in text.partition("="))
    if not equals or not key or not value:
        expected = "KEY=VALUE, for example solver.step=0.001"
        raise SceneError(key, f"got {text}", expected, KeyOrigin(override=text))
    try:
        return Override(key, value_of(value), text)
    except ValueError as error:
        raise SceneError(key, str(error), source=KeyOrigin(override=text)) from None


def value_of(text: str) -> Any:
    """Parse a TOML value; a bare word, as typed in a shell, is a text. Raise ValueError for any other text."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        if not re.fullmatch(r"[\w./:+-]+", text):
            raise ValueError(f"{text} is not a TOML value; quote a text") from None
        return text
    except RecursionError:
        raise ValueError(f"{text[:20]}... is nested too deeply; use fewer brackets") from None


def _plain(value: Any) -> Any:
    """Convert a value of Python or numpy to the types of TOML."""
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):
        value = value.tolist()
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


def is_below_file_name(tree: Any, key: str) -> bool:
    """Return True if a key is inside a text value, which may name a file that is not read yet."""
    for part in key.split(".")[:-1]:
        if isinstance(tree, list):
            tree = tree[int(part)] if part.isdigit() and int(part) < len(tree) else None
        else:
            tree = tree.get(part) if isinstance(tree, dict) else None
    return isinstance(tree, str)


def with_values(tree: dict[str, Any], overrides: Overrides) -> dict[str, Any]:
    """Return the tables of a resolved scene with overrides. See `apply` for errors."""
    result = copy.deepcopy(tree)
    for override in parse_all(overrides):
        apply(result, override)
    return result


def apply(tree: dict[str, Any], override: Override) -> None:
    """Set the value of an override in a tree of tables. Create missing tables.

    Raises:
        SceneError: a list has no such entry, or the key is below a value.
    """
    node: Any = tree
    *parents, last = override.key.split(".")
    for parent in parents:
        if isinstance(node, list):
            node = node[_index(node, parent, override)]
        elif isinstance(node, dict):
            node = node.setdefault(parent, {})
    value = copy.deepcopy(override.value)
    if isinstance(node, list):
        node[_index(node, last, override)] = value
    elif isinstance(node, dict):
        node[last] = value
    else:
        message = f"{'.'.join(parents)} is a value, not a table"
        raise SceneError(override.key, message, source=KeyOrigin(override=override.text))


def _index(items: list, text: str, override: Override) -> int:
    if not text.isdigit() or int(text) >= len(items):
        expected = f"an index from 0 to {len(items) - 1}"
        raise SceneError(override.key, f"got {text}", expected, KeyOrigin(override=override.text))
    return int(text)
